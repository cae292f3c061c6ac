"""Animated pictures of the README and the documentation's first page, as WebP.

`make moving-picture` pulls focus in the sample clip, through the command line in a process of its own, as a
user does. With `--screens` the window at work is made of the screenshots that `make pictures` takes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

if __name__ == "__main__" and not __package__:
    # Run as a file: PEP 366, so that the neighbours are imported as the package they are.
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    __package__ = "sample_scenes"

from .demo import ROOT, DemoError, Frames, read_clip, run_product

FOCUS = "0.2,0.85@6", "0.9,0.45@31"
"""The mug in front, and the plant at the wall."""
BLUR = 0.05
"""Fraction of the picture's width: enough to be seen where the README is read. By eye."""
DURATION, REST = 80, 700
"""Milliseconds of a frame, about half as fast as the clip, and of the first and the last."""
STEPS = "drop", "solving", "solved", "preview", "pick", "marks"
"""Screenshots, in the order of the work; then the focus is pulled."""
STEP, SCRUB = 1600, 160
"""Milliseconds for which a step is seen, and a frame of the pull."""
PART = slice(0.04, 0.95), slice(0.17, 0.825)
"""Shares of the window, down and across, in which the clip and the sidebar are. By eye."""
WIDTH = 960
"""Pixels of that part, as wide as a page shows it."""
HEAVIEST = 2_000_000
"""Bytes of an animation: a page that is opened on the way."""


def to_and_fro(frames: Frames) -> tuple[Frames, list[int]]:
    """Frames (n, H, W, 3) forwards and backwards, without a jump where they begin again, and milliseconds of
    each."""
    durations = np.full(2 * len(frames) - 2, DURATION)
    durations[[0, len(frames) - 1]] = REST
    return np.concatenate([frames, frames[-2:0:-1]]), durations.tolist()


def write_webp(out: Path, frames: Sequence[np.ndarray] | Frames, durations: Sequence[int]) -> int:
    """Write an animation of frames (H, W, 3), blue first, that goes on for ever, no larger than `HEAVIEST`;
    its quality, of 100. DemoError where none is as small."""
    animation = cv2.Animation()
    animation.frames, animation.durations = list(frames), list(durations)
    for quality in range(90, 20, -10):
        done, data = cv2.imencodeanimation(".webp", animation, [cv2.IMWRITE_WEBP_QUALITY, quality])
        if done and len(data) <= HEAVIEST:
            out.write_bytes(data.tobytes())
            return quality
    raise DemoError(f"{len(frames)} frames make more than {HEAVIEST} bytes.")


def at_work(folder: Path) -> tuple[list[np.ndarray], list[int]]:
    """Screenshots (H, W, 3) of the window, blue first, in the order of the work, and milliseconds of each.
    DemoError where one is missing."""
    pull = sorted(folder.glob("scrub_*.png"))
    files = [*(folder / f"{name}.png" for name in STEPS), *pull, *pull[-2:0:-1]]
    if not pull:
        raise DemoError(f"{folder} has no screenshots of a pull; call make pictures.")
    return [_small(file) for file in files], [STEP] * len(STEPS) + [SCRUB] * (len(files) - len(STEPS))


def _small(file: Path) -> np.ndarray:
    picture = cv2.imread(str(file))
    if picture is None:
        raise DemoError(f"{file} is missing; call make pictures.")
    rows, columns = (
        slice(round(part.start * length), round(part.stop * length))
        for part, length in zip(PART, picture.shape[:2], strict=True)
    )
    picture = picture[rows, columns]
    height = round(WIDTH * picture.shape[0] / picture.shape[1])
    return np.asarray(cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA))


def pulled(folder: Path) -> tuple[Frames, list[int]]:
    """The sample clip with its focus pulled, rendered in a folder, to and fro, and milliseconds of each
    frame. DemoError where it cannot be rendered."""
    folder.mkdir(parents=True, exist_ok=True)
    result = folder / "desk_focus_pull.mp4"
    run_product(ROOT / "sample_scenes" / "desk.mp4", result, folder / "desk.aperture", BLUR, FOCUS)
    return to_and_fro(read_clip(result))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--screens", type=Path, metavar="DIR", help="the window at work, of its screenshots")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.webp")
    parser.add_argument("--work-dir", type=Path, default=ROOT / "demo")
    arguments = parser.parse_args()
    try:
        screens: Path | None = arguments.screens
        frames, durations = pulled(arguments.work_dir) if screens is None else at_work(screens)
        quality = write_webp(arguments.out, frames, durations)
    except DemoError as error:
        print(f"moving picture: {error}", file=sys.stderr)
        return 1
    print(f"{arguments.out} ({arguments.out.stat().st_size / 1e6:.1f} MB, quality {quality})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
