"""Videos are shown as their containers say, and as Blender shows them where it can."""

from __future__ import annotations

from dataclasses import asdict, replace
from fractions import Fraction
from pathlib import Path

import av
import bpy
import cv2
import numpy as np
import pytest
from av.stream import Disposition

from addon.core.base.errors import Remedy, UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.clip import FrameRange, open_footage
from addon.core.media.container import equivalent_focal
from addon.core.media.light import to_linear
from addon.core.media.sequence import LAST_FRAME
from addon.core.media.video_info import VideoInfo
from addon.render.output import movie_file
from addon.scene.build import build
from addon.scene.sources.sound import clip_sounds
from benchmarks.odd_clips import SIZE
from benchmarks.odd_tracks import (
    MATRICES,
    Matrix,
    corners,
    encoded,
    pitch,
    remuxed,
    shown,
    with_clean_aperture,
    with_unknown_sound,
)

from ..scenes import slanted_plane
from ..variants import combined

FRAMES = [corners()] * 3
NEAR = 12
"""Grey levels by which lossless coding in YUV moves a colour at most."""


def blender_picture(scene: bpy.types.Scene, path: Path) -> np.ndarray | None:
    """The camera's background as Blender shows it (H, W, 3), in [0, 255]; None without one."""
    footage = open_footage(path)
    lens = Intrinsics(footage.width, footage.height, 60.0, 60.0, footage.width / 2, footage.height / 2)
    settings = build(scene, footage, slanted_plane(lens))
    if not settings.camera.data.background_images:
        assert not settings.points.hide_get() and "no background image" in settings.clip_notes
        return None
    background = settings.camera.data.background_images[0]
    width, height = background.image.size
    pixels = np.array(background.image.pixels[:]).reshape(height, width, -1)[::-1, :, :3] * 255
    pixels = pixels[:, ::-1] if background.use_flip_x else pixels
    return pixels[::-1] if background.use_flip_y else pixels


@pytest.mark.parametrize("matrix", MATRICES)
def test_every_display_matrix_is_applied_and_blender_shows_the_same(
    scene: bpy.types.Scene, tmp_path: Path, matrix: Matrix
) -> None:
    path = encoded(tmp_path / "a.mp4", [FRAMES], matrix=matrix)
    expected = shown(FRAMES[0], matrix)
    footage = open_footage(path)
    assert (footage.width, footage.height) == expected.shape[1::-1]
    assert np.array_equal(footage.read(2), expected)
    assert np.abs(blender_picture(scene, path) - expected).max() < NEAR


SMALL, LARGE = corners(), corners((128, 96))[::-1].copy()


@pytest.mark.parametrize("default", [0, 1])
def test_of_two_tracks_as_long_the_one_with_most_pixels_is_read(
    scene: bpy.types.Scene, tmp_path: Path, default: int
) -> None:
    tracks = [[SMALL] * 3, [LARGE] * 3] if default else [[LARGE] * 3, [SMALL] * 3]
    path = encoded(tmp_path / "a.mp4", tracks)
    footage = open_footage(path)
    assert (footage.width, footage.height) == (128, 96)
    for frame in (2, 1):
        assert np.array_equal(footage.read(frame), LARGE)
    picture = blender_picture(scene, path)
    assert picture is None if default else np.abs(picture - LARGE).max() < NEAR


def two_tracks(path: Path, tracks: list[tuple[np.ndarray, list[float], bool]]) -> Path:
    """A video with tracks of a picture (H, W, 3), the times that it is shown at in seconds, and whether it is
    a default one; of webm without durations."""
    codec, pixels = ("libvpx-vp9", "yuv420p") if path.suffix == ".webm" else ("libx264", "yuv420p")
    with av.open(str(path), "w", options={"live": "1"} if path.suffix == ".webm" else {}) as out:
        streams = []
        for picture, _, is_default in tracks:
            video = out.add_stream(codec, rate=25)
            video.height, video.width, video.pix_fmt = *picture.shape[:2], pixels
            video.time_base = video.codec_context.time_base = Fraction(1, 1000)
            video.disposition = Disposition.default if is_default else Disposition(0)
            streams.append(video)
        for video, (picture, times, _) in zip(streams, tracks, strict=True):
            for time in times:
                frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(format=pixels)
                frame.pts, frame.time_base = round(1000 * time), Fraction(1, 1000)
                out.mux(video.encode(frame))
            out.mux(video.encode())
    return path


def steady(count: int, rate: float = 25.0) -> list[float]:
    return [number / rate for number in range(count)]


type Shown = tuple[list[float], bool]
"""When a track's picture is shown, in seconds, and whether the track is a default one."""

TRACKS: dict[str, tuple[Shown, Shown, int]] = {
    "a phone's stills during the clip": ((steady(53), True), ([0.0, 52 / 25], True), 0),
    "a still that is held far longer": ((steady(12), False), ([0.0, 8.0], True), 0),
    "one frame, not marked as a cover": ((steady(12), False), ([0.0], True), 0),
    "the large one is shorter": ((steady(30), False), (steady(20), True), 0),
    "the large one is longer": ((steady(20), True), (steady(30), False), 1),
    "a longer one of a low rate": ((steady(25), True), (steady(10, 5.0), False), 1),
    "as long, but for a frame, by default": ((steady(25), True), (steady(26), False), 0),
    "as long, but for a frame, and larger": ((steady(26), True), (steady(25), True), 1),
    "as long at half the rate, and larger": ((steady(24), True), (steady(12, 12.5), True), 1),
}


@pytest.mark.parametrize(
    ("case", "suffix", "is_turned"), combined(TRACKS, [".mp4", ".webm", ".mov", ".mkv"], [False, True])
)
def test_the_longest_track_that_moves_is_read(
    tmp_path: Path, case: tuple[Shown, Shown, int], suffix: str, is_turned: bool
) -> None:
    both, wanted = case[:2], case[2]
    tracks = [(picture, *each) for picture, each in zip((SMALL, LARGE), both, strict=True)]
    path = two_tracks(tmp_path / f"a{suffix}", tracks[::-1] if is_turned else tracks)
    footage = open_footage(path)
    assert (footage.width, footage.height) == ((128, 96) if wanted else SIZE)
    assert len(footage.frames) == len(both[wanted][0])
    assert footage.read(len(footage.frames)).shape == (footage.height, footage.width, 3)


def test_a_phones_stills_during_its_clip_are_not_the_clip(data: Path) -> None:
    footage = open_footage(data / "clips/person_selfie_hevc_rot_1.mp4")
    assert len(footage.frames) == 53 and (footage.width, footage.height) == (1080, 1440)


@pytest.mark.parametrize("suffix", [".mp4", ".mkv"])
def test_hidden_rows_and_columns_are_not_shown(scene: bpy.types.Scene, tmp_path: Path, suffix: str) -> None:
    matrix = MATRICES[4]
    path = with_clean_aperture(
        encoded(tmp_path / "a.mp4", [FRAMES], matrix=matrix), (SIZE[0] - 16, SIZE[1] - 8), right=4, down=-2
    )
    if suffix == ".mkv":
        path = remuxed(path, tmp_path / "a.mkv")
    footage = open_footage(path)
    expected = shown(FRAMES[0][2:-6, 12:-4], matrix)
    assert np.array_equal(footage.read(1), expected)
    assert (footage.width, footage.height) == expected.shape[1::-1]
    assert blender_picture(scene, path) is None


def joined(scene: bpy.types.Scene, clip: Path, out: Path) -> Path:
    """A movie of the clip's own pictures with its sound."""
    footage = open_footage(clip)
    build(scene, footage, slanted_plane(Intrinsics(*SIZE, 60.0, 60.0, SIZE[0] / 2, SIZE[1] / 2)))
    files = {frame: out.with_name(f"{frame:04d}.png") for frame in footage.frames}
    for frame, file in files.items():
        cv2.imwrite(str(file), footage.read(frame)[..., ::-1])
    movie_file.join(scene, files, out)
    return out


def test_the_first_sound_that_can_be_decoded_is_the_movies(scene: bpy.types.Scene, tmp_path: Path) -> None:
    path = encoded(tmp_path / "a.mp4", [[corners()] * 25], sounds=(440.0, 1000.0))
    assert pitch(joined(scene, path, tmp_path / "first.mp4")) == pytest.approx(440, rel=0.02)
    movie = joined(scene, with_unknown_sound(path), tmp_path / "second.mp4")
    assert pitch(movie) == pytest.approx(1000, rel=0.02)
    (note,) = open_footage(path).notes
    assert "apac" in note and "track 2" in note
    # The sound is in the .blend, from which other processes and farms render.
    (strip,) = clip_sounds(scene)
    assert strip.sound.packed_file is not None and not Path(strip.sound.filepath).is_relative_to(
        "/tmp/virtual"
    )


def test_a_sound_that_cannot_be_decoded_is_named(scene: bpy.types.Scene, tmp_path: Path) -> None:
    path = with_unknown_sound(encoded(tmp_path / "a.mp4", [[corners()] * 25], sounds=(440.0,)))
    (note,) = open_footage(path).notes
    assert "(apple_apac) cannot be decoded: movies are silent" in note
    with av.open(str(joined(scene, path, tmp_path / "movie.mp4"))) as movie:
        assert not movie.streams.audio


@pytest.mark.parametrize(("written", "read"), [("26", 26.0), ("26.5", 26.5), ("0", None), ("wide", None)])
def test_the_equivalent_focal_length_is_read(tmp_path: Path, written: str, read: float | None) -> None:
    source = encoded(tmp_path / "a.mov", [[corners()] * 2])
    assert equivalent_focal(source) is None
    with (
        av.open(str(source)) as pictures,
        av.open(str(tmp_path / "b.mov"), "w", options={"movflags": "use_metadata_tags"}) as out,
    ):
        out.metadata["com.apple.quicktime.camera.focal_length.35mm_equivalent"] = written
        copy = out.add_stream_from_template(pictures.streams.video[0])
        for packet in pictures.demux(pictures.streams.video[0]):
            if packet.dts is not None:
                packet.stream = copy
                out.mux(packet)
    assert equivalent_focal(tmp_path / "b.mov") == read


@pytest.mark.parametrize(
    ("name", "codec", "pixels"),
    [
        ("a.mov", "prores_ks", "yuva444p10le"), ("a.mov", "qtrle", "argb"), ("a.mov", "png", "rgba64be"),
    ],
)  # fmt: skip
def test_alpha_is_read_as_that_of_pictures_is(tmp_path: Path, name: str, codec: str, pixels: str) -> None:
    alpha = np.linspace(0, 255, SIZE[0]).round().astype(np.uint8)
    picture = np.dstack([np.full((*SIZE[::-1], 3), 200, np.uint8), np.tile(alpha, (SIZE[1], 1))])
    options = {"profile": "4444"} if codec == "prores_ks" else {"strict": "experimental"}
    footage = open_footage(encoded(tmp_path / name, [[picture] * 3], codec, pixels, **options))
    read = footage.read(2)
    top = np.iinfo(read.dtype).max
    assert read.shape == (*SIZE[::-1], 4)
    assert np.abs(read / top - picture / 255).max() < 0.01
    linear = to_linear(read)
    # FFmpeg's encoders dither 8 bits to 12.
    assert np.allclose([linear[0, 0, 0], linear[0, -1, 3]], [0, 1], atol=0.002)


def test_bytes_that_pad_colours_are_no_alpha(tmp_path: Path) -> None:
    picture = np.dstack([corners(), np.zeros(SIZE[::-1], np.uint8)])
    footage = open_footage(encoded(tmp_path / "a.avi", [[picture] * 3], "rawvideo", "bgra"))
    assert np.array_equal(footage.read(1), corners())


def test_alpha_that_is_not_decoded_is_named(tmp_path: Path) -> None:
    picture = np.dstack([corners(), np.full(SIZE[::-1], 99, np.uint8)])
    path = encoded(tmp_path / "a.webm", [[picture] * 3], "libvpx-vp9", "yuva420p", **{"auto-alt-ref": "0"})
    (note,) = open_footage(path).notes
    assert "transparency is not read" in note and "ProRes 4444" in note


def test_interlaced_clips_are_named(tmp_path: Path) -> None:
    options = {"x264-params": "interlaced=1", "qp": "10"}
    path = encoded(tmp_path / "a.mp4", [FRAMES], "libx264", "yuv420p", **options)
    (note,) = open_footage(path).notes
    assert "is interlaced" in note and "deinterlace" in note


def of_two_sizes(folder: Path, size: tuple[int, int]) -> Path:
    """A transport stream whose frames 4 to 6 have another size (width, height)."""
    parts = [
        encoded(folder / f"{number}.ts", [[corners(each)] * 3], "libx264", "yuv420p", g="1", qp="0", bf="0")
        for number, each in enumerate((SIZE, size))
    ]
    with av.open(str(folder / "a.ts"), "w") as out:
        stream, after = None, 0
        for part in parts:
            with av.open(str(part)) as source:
                stream = stream or out.add_stream_from_template(source.streams.video[0])
                packets = [packet for packet in source.demux(video=0) if packet.dts is not None]
                for packet in packets:
                    packet.pts, packet.dts = packet.pts + after, packet.dts + after
                    packet.stream = stream
                    out.mux(packet)
            after += 3 * 3600
    return folder / "a.ts"


def test_pictures_that_change_their_size_are_scaled(tmp_path: Path) -> None:
    footage = open_footage(of_two_sizes(tmp_path, (128, 96)))
    assert len(footage.frames) == 6 and footage.video.sizes == ((1, 64, 48), (4, 128, 96))
    for frame in (2, 5, 4):
        assert np.abs(footage.read(frame)[[4, -4], :20].astype(int) - corners()[[4, -4], :20]).max() < NEAR
    assert "128x96 from frame 4" in footage.notes[0]
    assert VideoInfo.parse(asdict(footage.video)) == footage.video


def test_pictures_that_change_their_shape_are_refused_with_the_frame(tmp_path: Path) -> None:
    path = of_two_sizes(tmp_path, (48, 64))
    with pytest.raises(UserError, match=r"from 64x48 to 48x64 pixels at frame 4; choose frames before it"):
        open_footage(path)
    assert open_footage(path, FrameRange(1, 3)).read(3).shape == (48, 64, 3)


def test_a_video_past_blenders_last_frame_is_refused_but_for_frames_before_it(tmp_path: Path) -> None:
    path = encoded(tmp_path / "a.mp4", [FRAMES])
    info = open_footage(path).video
    assert info is not None
    days = replace(info, times=tuple(range(LAST_FRAME + 1)))
    with pytest.raises(UserError, match="frames 1 to 1048575, but Blender's last frame is 1048574") as caught:
        open_footage(path, info=days)
    assert Remedy.FRAMES in caught.value.remedies
    assert open_footage(path, FrameRange(2, 3), info=days).frames == (2, 3)
