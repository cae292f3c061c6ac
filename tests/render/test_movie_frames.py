"""Movies show every rendered frame, at its time, whatever rate the clip has."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.errors import Remedy, UserError
from addon.core.media.clip import open_footage
from addon.render.output import frame_files, movie_file
from addon.scene.build import blender_rate, build
from benchmarks.odd_clips import SIZE
from benchmarks.torture import clip as solved

from ..variants import variants

LENS = solved.Intrinsics(*SIZE, 60.0, 60.0, SIZE[0] / 2, SIZE[1] / 2)
TICK = Fraction(1, 960_000)
"""Seconds: whole numbers of it, or nearly, are between frames of all rates here."""
BITS = 6
"""Squares in a picture's row that carry its number."""


def picture(number: int) -> np.ndarray:
    """A picture (H, W, 3) with its number in black and white squares, most significant first."""
    bits = [255 * (number >> bit & 1) for bit in range(BITS)][::-1]
    made = np.full((SIZE[1], SIZE[0], 3), 128, np.uint8)
    made[:, 2 : 2 + 10 * BITS] = np.repeat(np.array(bits, np.uint8), 10)[None, :, None]
    return made


def number_in(gray: np.ndarray) -> int:
    """The number in a decoded picture."""
    squares = gray[12:-12, 2 : 2 + 10 * BITS].reshape(-1, BITS, 10)[..., 3:7].mean(axis=(0, 2)) > 128
    return int("".join(str(int(each)) for each in squares), 2)


def clip_of(path: Path, times: Sequence[Fraction], tick: Fraction = TICK) -> Path:
    """A clip with numbered pictures at times in seconds."""
    with av.open(str(path), "w") as out:
        video = out.add_stream("libx264", rate=25, options={"qp": "10", "bf": "0"})
        video.width, video.height, video.pix_fmt = *SIZE, "yuv420p"
        video.time_base = video.codec_context.time_base = tick
        for number, time in enumerate(times):
            frame = av.VideoFrame.from_ndarray(picture(number), format="rgb24")
            frame.pts, frame.time_base = round(time / tick), tick
            out.mux(video.encode(frame))
        out.mux(video.encode())
    return path


def joined(scene: bpy.types.Scene, path: Path, out: Path) -> Path:
    """A movie of the clip's own pictures, as if they had been rendered."""
    footage = open_footage(path)
    build(scene, footage, solved.truth(range(1, 9), LENS))
    out.parent.mkdir(exist_ok=True)
    files = {frame: out.with_name(f"{frame:06d}.png") for frame in footage.frames}
    for number, file in enumerate(files.values()):
        cv2.imwrite(str(file), picture(number))
    movie_file.join(scene, files, out)
    return out


def shown_in(movie: Path) -> tuple[np.ndarray, np.ndarray, float]:
    """When each number is first shown, in seconds, the numbers in their order, and seconds of a frame."""
    with av.open(str(movie)) as held:
        shown = [
            (float(frame.time), number_in(frame.to_ndarray(format="gray"))) for frame in held.decode(video=0)
        ]
    times, numbers = map(np.array, zip(*shown, strict=True))
    begins = np.flatnonzero(np.diff(numbers, prepend=-1))
    apart = float(np.diff(times).mean()) if len(times) > 1 else 0.0
    return times[begins] - times[0], numbers[begins], apart


STEADY = ("1/10", "1", "12.5", "23.976", "24000/1001", "25", "29.97", "59.94", "119.88", "240", "241", "999",
          "1000", "1001", "1500", "2000", "5000")  # fmt: skip


@pytest.mark.parametrize("suffix", variants([".mp4", ".mov", ".mkv"], 1))
@pytest.mark.parametrize("rate", STEADY)
def test_every_frame_of_a_steady_clip_is_shown_at_its_time(
    scene: bpy.types.Scene, tmp_path: Path, rate: str, suffix: str
) -> None:
    count = 36 if rate != "1/10" else 5
    times = [number / Fraction(rate) for number in range(count)]
    path, out = clip_of(tmp_path / "a.mp4", times), tmp_path / "o" / f"o{suffix}"
    assert not open_footage(path).notes
    if suffix == ".mkv" and Fraction(rate) > 1000:
        with pytest.raises(
            UserError, match=rf"o\.mkv would have {rate} frames.* holds at most 1000; choose a \.mp4"
        ):
            joined(scene, path, out)
        assert not out.exists()
        return
    shown, numbers, _ = shown_in(joined(scene, path, out))
    assert numbers.tolist() == list(range(count))
    coarse = 1e-3 if suffix == ".mkv" else 1e-4
    assert np.abs(shown - np.array(times, float)).max() < coarse + 1e-5 * float(times[-1])


def varying(seed: int) -> list[Fraction]:
    """Times of up to 60 frames: parts of several rates, jitter, glitches of up to 4 frames and long gaps."""
    dice, at, times = np.random.default_rng(seed), 0.0, list[float]()
    for _ in range(dice.integers(2, 5)):
        rate = float(dice.choice([1, 5, 12.5, 24, 29.97, 60, 120, 240, 480, 960]))
        for _ in range(dice.integers(3, 14)):
            times.append(at)
            at += (1 + dice.uniform(-0.2, 0.2)) / rate
        if dice.random() < 0.4:
            times += [times[-1] + 0.001 * number for number in range(1, dice.integers(2, 5))]
            at = max(at, times[-1] + 0.002)
        at += float(dice.choice([0, 0, 0.3, 3.0]))
    return [TICK * round(time / float(TICK)) for time in times]


@pytest.mark.parametrize("seed", variants(range(16), 1))
def test_every_frame_of_a_varying_clip_is_shown_near_its_time(
    scene: bpy.types.Scene, tmp_path: Path, seed: int
) -> None:
    times = varying(seed)
    path = clip_of(tmp_path / "a.mp4", times)
    suffix = (".mp4", ".mov", ".mkv")[seed % 3]
    shown, numbers, apart = shown_in(joined(scene, path, tmp_path / "o" / f"o{suffix}"))
    assert numbers.tolist() == list(range(len(times)))
    off = np.abs(shown - np.array(times, float) + float(times[0]))
    note = next((note for note in open_footage(path).notes if "variable frame rate" in note), "")
    if "keep each frame's time," in note:
        assert off.max() <= 1.5 * apart  # the first may begin half a frame off
    elif note:
        assert off.max() <= 2 * float(note.split("time to ")[1].split()[0])


def test_too_many_frames_for_blender_are_named_before(scene: bpy.types.Scene, tmp_path: Path) -> None:
    times = [Fraction(number, 25) for number in range(9)] + [Fraction(43_200)]
    footage = open_footage(clip_of(tmp_path / "a.mp4", times, Fraction(1, 12_000)))
    with pytest.raises(
        UserError, match=r"o\.mp4 would have 1080001 frames, of 25 a second.*pictures"
    ) as caught:
        movie_file.check_rate(tmp_path / "o.mp4", footage, footage.frames)
    assert Remedy.FRAMES in caught.value.remedies
    movie_file.check_rate(tmp_path / "####.png", footage, footage.frames)
    movie_file.check_rate(tmp_path / "o.mp4", footage, footage.frames[:9])


def test_movies_of_other_pictures_or_times_are_found(scene: bpy.types.Scene, tmp_path: Path) -> None:
    out = joined(
        scene, clip_of(tmp_path / "a.mp4", [Fraction(number, 25) for number in range(12)]), tmp_path / "o.mp4"
    )
    files = {number: tmp_path / f"{number:06d}.png" for number in range(1, 13)}
    assert not frame_files.movie_problem(out, 12, SIZE, 25.0)
    assert not frame_files.shown_problem(out, files, range(1, 13), SIZE)
    assert "shows frame 2 at 0.04 s and should at 0.0416667 s" in frame_files.movie_problem(
        out, 12, SIZE, 24.0
    )
    assert "no place for rendered frames 5" in frame_files.shown_problem(
        out, files, [1, 2, 3, 4, 4, *range(6, 13)], SIZE
    )
    files[7], files[8] = files[8], files[7]
    assert "shows another picture at frame 7 and should show 000008.png" in frame_files.shown_problem(
        out, files, range(1, 13), SIZE
    )


def test_blenders_encoder_gets_rates_without_cut_digits() -> None:
    dice = np.random.default_rng(0)
    for fps in [*(float(Fraction(rate)) for rate in STEADY), 1 / 3600, *np.exp(dice.uniform(-5, 7, 300))]:
        whole, base = blender_rate(fps)
        assert isinstance(whole, int) and 1 <= whole <= 32767
        assert base == 1.001 or base == int(base)
        assert whole / base == pytest.approx(fps, rel=4e-5)
