"""How far sound and pictures are apart in movies of a clip whose rate varies.

python -m benchmarks.special sound_offset                 ten minutes; writes results/sound_offset.md
python -m benchmarks.special sound_offset --minutes 0.5   a look

A clip changes between 24, 30 and 60 frames a second, flashes at frames spread over its length and clicks at
each flash. Its own pictures take the way of rendered ones into a movie
(`addon/render/output/movie_file.py`), with sound from the beginning, and with sound that begins 0.48 s late.
The movie is then looked at and listened to: every change of its picture is set against the clip's times,
and every flash against its click.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import bpy
import cv2
import numpy as np
from numpy.typing import NDArray

import addon
from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.clip import Footage, open_footage
from addon.render.output import movie_file
from addon.render.views.quiet import quiet
from addon.scene.build import build

from . import store
from .odd_clips import SIZE, clicks, pictures, varying, write
from .torture import clip as solved

TABLE = store.ROOT / "benchmarks" / "results" / "sound_offset.md"
EVERY = 2.37
"""Seconds between flashes: no whole number of frames of any rate, so that they fall anywhere."""
CHANGED = 5.0
"""Grey levels, in the mean, from which a picture is another: with it as many are found as the clip has."""
LATE = (0.0, 0.48)
"""Seconds from the first picture to the first sound."""
LENS = Intrinsics(*SIZE, 60.0, 60.0, SIZE[0] / 2, SIZE[1] / 2)


def main() -> None:
    """Measure, print, and write the table where all of the ten minutes were measured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--each", type=int, default=20, metavar="SECONDS", help="of each rate")
    options = parser.parse_args()
    addon.register()
    lines = [
        "# Sound and pictures of a varying rate", "",
        f"Written by `python -m benchmarks.special sound_offset`; {store.provenance()}.",
        f"{options.minutes:g} minutes, 24, 30 and 60 frames a second for {options.each} s each in turn.", "",
        "| sound begins | frames of the clip, of the movie | its rate | a frame from its own time, largest |"
        " a flash from its click, largest | by the mean rate |",
        "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for late in LATE:
        with tempfile.TemporaryDirectory() as folder:
            lines.append(measured(Path(folder), round(60 * options.minutes), options.each, late))
            print(lines[-1], flush=True)
    lines += [
        "",
        "Frames are those of the movie, the shortest of the clip's. A click is heard to 0.001 of them.",
    ]
    text = "\n".join(lines) + "\n"
    print(text)
    if options.minutes >= 10:
        TABLE.write_text(text)


def measured(folder: Path, seconds: int, turn: int, late: float) -> str:
    """A row of the table."""
    times = varying(seconds, each=turn)
    own = np.array(times, np.float64)
    lit = np.unique(np.searchsorted(own, np.arange(EVERY, own[-1], EVERY)))
    flashes = [times[int(at)] for at in lit]
    path = write(folder / "clip.mp4", times, sound=seconds - late, late=late, flashes=flashes)
    movie, footage = joined(path, folder / "movie")
    assert footage.video is not None
    rate = footage.video.movie_rate
    shown, greys = pictures(movie)
    change = np.abs(np.diff(greys.astype(np.int16), axis=0)).mean(axis=(1, 2))
    begins = shown[np.concatenate([[True], change > CHANGED])]
    heard = clicks(movie)
    if len(begins) != len(own) or len(heard) != len(lit):
        raise SystemExit(f"{len(begins)} of {len(own)} frames seen, {len(heard)} of {len(lit)} clicks heard")
    # The clip itself is measured the same way: where a click is found depends on its coding.
    offset = heard - own[lit] - (clicks(path) - own[lit])
    frames = np.abs(begins - own - np.median(offset)) * rate
    sound = np.abs(begins[lit] - own[lit] - offset) * rate
    mean = np.abs(own - np.arange(len(own)) / footage.fps)[lit] * rate
    cells = " | ".join(map(_as_time, (frames, sound, mean), (rate,) * 3))
    return f"| {late:.2f} s | {len(own)}, {len(shown)} | {rate:g} | {cells} |"


def _as_time(off: NDArray[np.float64], rate: float) -> str:
    worst = float(off.max())
    seconds = f"{worst / rate:.1f} s" if worst > rate else f"{1000 * worst / rate:.2f} ms"
    return f"{worst:.3g} frames ({seconds})"


def joined(path: Path, folder: Path) -> tuple[Path, Footage]:
    """A movie of a clip's own pictures, as if they had been rendered, and the clip."""
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    footage = open_footage(path)
    build(bpy.context.scene, footage, solved.truth(range(1, 9), LENS))
    folder.mkdir()
    files = {frame: folder / f"{frame:06d}.png" for frame in footage.frames}
    for frame, file in files.items():
        cv2.imwrite(str(file), footage.read(frame)[..., ::-1])
    movie = folder.with_suffix(".mp4")
    with quiet(1):
        movie_file.join(bpy.context.scene, files, movie)
    return movie, footage


if __name__ == "__main__":
    main()
