"""What `make demo` runs: depth of field for the sample clip, and pictures that show what it did.

The product is used the way a user does, through its command line in a process of its own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

if __name__ == "__main__" and not __package__:
    # Run as a file: PEP 366, so that the neighbours are imported as the package they are.
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    __package__ = "sample_scenes"

from addon.render.views.quiet import quiet

from . import clip, desk, stage

Frames = NDArray[np.uint8]

ROOT = Path(__file__).resolve().parents[1]
BLUR = 0.03
"""The command line's --blur: a fraction of the picture's width, here a clearly visible one."""
BACKGROUND = (0.04, 0.12, 0.20, 0.52)
"""Books on the far wall in every frame: left, top, right, bottom as fractions of the picture."""
DIVIDER = 2
"""Pixels between source and result on either side of the middle."""


class DemoError(Exception):
    """Why there is nothing to show."""


@dataclass(frozen=True)
class Showing:
    """The files made, and how much detail is left: result over source, 1 is untouched."""

    clip: Path
    still: Path
    subject: float
    background: float


def subject_place() -> tuple[float, float]:
    """The subject in the first frame, as fractions of the picture's width and height."""
    x, y = desk.truth().project(desk.SUBJECT[None])[0, 0]
    return float(x / stage.WIDTH), float(y / stage.HEIGHT)


def subject_box(frame: int) -> tuple[float, float, float, float]:
    """The square within the globe's outline on a frame (from 0): left, top, right, bottom fractions."""
    known = desk.truth()
    x, y = known.project(desk.SUBJECT[None])[frame, 0]
    half = 0.7 * desk.SUBJECT_RADIUS * known.focal / known.subject_depth[frame]
    left, top, right, bottom = np.array([x - half, y - half, x + half, y + half]) / (
        [stage.WIDTH, stage.HEIGHT] * 2
    )
    return float(left), float(top), float(right), float(bottom)


def run_product(source: Path, out: Path, work: Path, blur: float, focus: Sequence[str]) -> None:
    """Call the command line on the clip, with `focus` at places X,Y or X,Y@FRAME; its own output goes
    through."""
    command = [sys.executable, str(ROOT / "addon" / "headless.py"), "run", str(source.resolve())]
    command += [word for place in focus for word in ("--focus-at", place)] + ["--blur", f"{blur:g}"]
    command += ["--out", str(out.resolve()), "--work", str(work.resolve()), "--overwrite"]
    out.unlink(missing_ok=True)  # an earlier run's clip must not pass for this one's
    print("$", " ".join(command), flush=True)
    status = subprocess.run(command, cwd=ROOT, check=False).returncode
    if status:
        raise DemoError(f"The command line ended with status {status}; its message is above.")
    if not out.is_file():
        raise DemoError(f"The command line reported success but wrote no clip at {out}.")


def read_clip(path: Path) -> Frames:
    """All frames (N, H, W, 3), blue first as OpenCV has them."""
    capture = cv2.VideoCapture(str(path))
    frames = []
    while (got := capture.read())[0]:
        frames.append(got[1])
    capture.release()
    if not frames:
        raise DemoError(f"No frames could be read from {path}.")
    return np.stack(frames)


def beside(source: Frames, result: Frames) -> Frames:
    """Source left, result right, a thin light line between: (..., H, 2 W, 3)."""
    pair = np.concatenate([source, result], axis=-2)
    middle = source.shape[-2]
    pair[..., middle - DIVIDER // 2 : middle + DIVIDER // 2, :] = 235
    return pair


def sharpness(picture: Frames, box: tuple[float, float, float, float]) -> float:
    """Variance of the Laplacian within a box of fractions: how much fine detail there is."""
    height, width = picture.shape[:2]
    left, top, right, bottom = (
        round(edge * size) for edge, size in zip(box, (width, height) * 2, strict=True)
    )
    grey = cv2.cvtColor(picture[top:bottom, left:right], cv2.COLOR_BGR2GRAY)
    return float(cv2.Laplacian(grey, cv2.CV_64F).var())


def show(source: Path, result: Path, out_dir: Path) -> Showing:
    """Make the before-and-after clip and still, and measure what became of the detail."""
    before, after = read_clip(source), read_clip(result)
    if before.shape != after.shape:
        sizes = " and ".join(f"{len(f)} frames of {f.shape[2]}x{f.shape[1]}" for f in (before, after))
        raise DemoError(f"Source and result do not match: {sizes}.")
    pairs = beside(before, after)
    middle = len(pairs) // 2
    out_dir.mkdir(parents=True, exist_ok=True)
    film, still = out_dir / "desk_before_after.mp4", out_dir / "desk_side_by_side.png"
    with tempfile.TemporaryDirectory() as scratch:
        names = [Path(scratch) / f"{index:04d}.png" for index in range(len(pairs))]
        for name, pair in zip(names, pairs, strict=True):
            cv2.imwrite(str(name), pair)
        with quiet(1):
            clip.encode(names, film, stage.FPS)
    cv2.imwrite(str(still), pairs[middle])
    kept = [
        sharpness(after[middle], box) / sharpness(before[middle], box)
        for box in (subject_box(middle), BACKGROUND)
    ]
    return Showing(film, still, *kept)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--source", type=Path, default=ROOT / "sample_scenes" / "desk.mp4")
    parser.add_argument("--out-dir", type=Path, default=ROOT / "demo")
    parser.add_argument("--blur", type=float, default=BLUR, help="as the command line's --blur")
    arguments = parser.parse_args()
    result = arguments.out_dir / "desk_depth_of_field.mp4"
    try:
        arguments.out_dir.mkdir(parents=True, exist_ok=True)
        x, y = subject_place()
        work = arguments.out_dir / "desk.aperture"
        run_product(arguments.source, result, work, arguments.blur, [f"{x:.3f},{y:.3f}"])
        shown = show(arguments.source, result, arguments.out_dir)
    except DemoError as error:
        print(f"demo: {error}", file=sys.stderr)
        return 1
    print(f"result            {result}")
    print(f"before and after  {shown.clip}")
    print(f"side by side      {shown.still}")
    print(f"detail kept       subject {shown.subject:.2f}, background {shown.background:.2f} (1 = all)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
