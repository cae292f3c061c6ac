"""Clips as other programs make them: read whole with picture and sound together, or what is wrong is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.clip import Footage, open_footage

from .. import odd_tracks
from ..odd_clips import LISTS, SIZE, flashes_and_clicks, flipped, packets, steady, varying, write
from ..odd_tracks import MATRICES, corners, encoded, pitch, with_clean_aperture, with_unknown_sound
from . import clip
from .bench import LENS, Try

CAMERA = Intrinsics(*SIZE, 60.0, 60.0, SIZE[0] / 2, SIZE[1] / 2)
KINDS = (
    ("a.mkv", "libx264"), ("a.mkv", "libx265"), ("a.webm", "libvpx-vp9"), ("a.webm", "libvpx"),
    ("a.ts", "libx264"), ("a.ts", "mpeg2video"), ("a.mp4", "libx264"), ("a.mp4", "libsvtav1"),
    ("a.mov", "mpeg4"), ("a.avi", "mpeg4"), ("a.avi", "mjpeg"),
)  # fmt: skip
TELLING = (("a.mov", "mpeg4"), ("a.avi", "mpeg4"), ("a.avi", "mjpeg"))
"""Whose decoders tell of every damaged packet, however small its picture is."""
CODED = 8
"""Grey levels by which a picture that is decoded whole differs at most from itself: none of it is made up."""
HEARD = 0.003
"""Seconds by which lossy coding moves what is heard as a click's beginning."""
PITCH = 0.02
"""Relative error of a pitch that is found in half a second of sound."""
OPUS = 0.0135
"""Seconds at its beginning that Blender leaves out of Opus: a packet, less its pre-skip."""


def odd(one: Try) -> None:
    """A whole clip: sound that is longer or late, a varying rate. Its movie shows and sounds as it does."""
    name, codec = one.dice.choice(KINDS)
    can_vary = name.endswith((".mkv", ".mp4", ".mov", ".webm")) and codec != "libsvtav1"
    times = one.dice.choice([steady(60), varying(3, each=1)]) if can_vary else steady(60)
    late = one.dice.choice([0.0, 0.48]) if name.endswith((".mkv", ".mp4")) else 0.0
    flashes = [times[at] for at in (18, 40)]
    sound = float(times[-1]) + one.dice.uniform(0.1, 0.6) - late
    path = write(one.folder / name, times, codec, sound, late, flashes)
    try:
        footage = open_footage(path)
    except UserError as error:
        one.verdict.add("lost", f"{name}, {codec}: {error}")
        return
    if len(footage.frames) != len(times) or any("rate varies" not in note for note in footage.notes):
        one.verdict.add("wrong", f"{name}, {codec}: {len(footage.frames)} of {len(times)}; {footage.notes}")
        return
    work, movie = clip.solve(path, one.folder / "work", CAMERA), one.folder / "out.mp4"
    run = one.run("render", work, *LENS, "--out", movie)
    if run.status:
        one.verdict.add("lost", f"{name}, {codec}: {run.said[-300:]}")
        return
    lit, heard = flashes_and_clicks(movie)
    if len(lit) != 2 or len(heard) != 2:
        one.verdict.add("wrong", f"{name}, {codec}: {len(lit)} flashes, {len(heard)} clicks")
        return
    video = footage.video
    shortest = float(np.diff(video.seconds).min()) if video is not None else 0.0
    own = np.subtract(*flashes_and_clicks(path))
    known = HEARD + (OPUS if name.endswith(".webm") else 0.0)
    if np.abs(lit - heard - own).max() > shortest / 2 + known:
        one.verdict.add("wrong", f"{name}, {codec}: flashes {lit}, clicks {heard}, late {late}")


def shown(one: Try) -> None:
    """A clip that is turned or mirrored, cropped, beside a smaller track, or whose first sound nothing
    decodes: shown as players do, and heard."""
    matrix, small = one.dice.choice(MATRICES), corners()
    large = np.kron(small, np.ones((2, 2, 1), np.uint8))
    tracks = [[large] * 12, [small] * 12] if one.dice.random() < 0.5 else [[large] * 12]
    one.dice.shuffle(tracks)
    path = encoded(one.folder / "a.mp4", tracks, matrix=matrix, sounds=(440.0, 1000.0))
    expected, tone = odd_tracks.shown(large, matrix), 440.0
    if len(tracks) == 1 and one.dice.random() < 0.5:
        with_clean_aperture(path, (SIZE[0] * 2 - 16, SIZE[1] * 2 - 8), right=4, down=-2)
        expected = odd_tracks.shown(large[2:-6, 12:-4], matrix)
    if one.dice.random() < 0.5:
        with_unknown_sound(path)
        tone = 1000.0
    footage = open_footage(path)
    if not np.array_equal(footage.read(one.dice.randint(1, 12)), expected):
        one.verdict.add("wrong", f"{matrix}, {len(tracks)} tracks: {footage.width}x{footage.height}")
        return
    camera = Intrinsics(footage.width, footage.height, 120.0, 120.0, footage.width / 2, footage.height / 2)
    movie = one.folder / "out.mp4"
    run = one.run("render", clip.solve(path, one.folder / "work", camera), *LENS, "--out", movie)
    if run.status:
        one.verdict.add("lost", run.said[-300:])
    elif abs(pitch(movie) / tone - 1) > PITCH:
        one.verdict.add("wrong", f"a tone of {pitch(movie):.0f} Hz, not {tone:.0f}")


def broken(one: Try) -> None:
    """A packet is damaged, or the end is cut off: a frame is named, or all is refused, or read the same."""
    name, codec = one.dice.choice(TELLING)
    path = write(one.folder / name, steady(60), codec, block=4)
    whole = open_footage(path)
    if one.dice.random() < 0.5:
        flipped(path, one.dice.randrange(60), one.dice.randrange(1 << 30))
    elif name.endswith(".avi"):
        path.write_bytes(path.read_bytes()[: packets(path)[one.dice.randint(1, 59)][0]])
    try:
        damaged = open_footage(path)
    except UserError:
        return
    video = damaged.video
    assert video is not None
    first = min([*video.damaged, len(damaged.frames) + 1 if video.missing else 61])
    if bad := [frame for frame in range(1, first) if not _is_same(whole, damaged, frame)]:
        one.verdict.add("wrong", f"{name}, {codec}: frames {bad[:3]} differ; told: {damaged.notes}")


def _is_same(whole: Footage, damaged: Footage, frame: int) -> bool:
    try:
        pair = whole.read(frame).astype(int), damaged.read(frame).astype(int)
    except UserError:
        return True  # refused, and by its number
    return pair[0].shape == pair[1].shape and bool(np.abs(pair[0] - pair[1]).max() <= CODED)


def lists(one: Try) -> None:
    """A text that leads to another file, by the name of a video, as the clip of a stranger's solve."""
    work = one.bench.project(one.folder / "project")
    video = one.folder / "project" / "clip" / "clip.mp4"
    video.rename(video.with_name("clip.ts" if one.dice.random() < 0.5 else "theirs.mp4"))
    video.write_text(LISTS[one.dice.choice(list(LISTS))].replace("clip.mp4", "theirs.mp4"))
    out = Path(one.folder / "out.mp4")
    for words in (("render", work), ("run", video, "--work", one.folder / "new")):
        run = one.run(*words, *LENS, "--out", out)
        if run.status == 0 or out.exists():
            one.verdict.add("wrong", f"{words[0]}: not refused: {run.said[-300:]}")
