"""Crops of the duck's rendered frames side by side, for looking at.

Solves the clip (kept under build/bench), renders every so many frames as a user would, and follows places of
the scene through them: each row is a place, its first column the source's crop in the middle frame.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats
from addon.core.camera.reconstruction import Reconstruction
from addon.core.focus.focus import Focus
from addon.core.media.clip import open_footage
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import Solve, load_solve

from .. import store
from ..gallery.clips import DATA
from ..picked import pick

Pixels = NDArray[np.uint8]

PLACES = {"duck": (0.5, 0.7), "mannequin": (0.84, 0.36), "card and chart": (0.27, 0.66), "gap": (0.73, 0.6)}
"""Where they are seen in the middle frame, in shares of its width and height."""
FOCUS, BLUR = "0.5,0.62@60", 0.04
MIDDLE = 60
SIZE = 170
"""Pixels of a crop's side."""
OUT = store.ROOT / "docs" / "duck_crops.jpg"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--step", type=int, default=13, help="frames between two that are rendered")
    parser.add_argument("--out", type=Path, default=OUT)
    arguments = parser.parse_args()
    clip = DATA / "duck" / "demo.mp4"
    if not clip.exists():
        raise SystemExit(f"{clip} is missing (set VA_DATA to the folder that holds the test data)")
    solve = solved(clip)
    frames = rendered(solve, arguments.step)
    middle = np.asarray(open_footage(clip).read(MIDDLE)[..., :3], np.uint8)
    rows = [row(solve.reconstruction, middle, place, frames) for place in PLACES.values()]
    # The corner is always where it is: the border must be clean there.
    corner = np.array(middle.shape[1::-1]) - SIZE / 2
    rows.append(np.hstack([cropped(picture, corner) for picture in (middle, *frames.values())]))
    sheet = np.vstack(rows)
    arguments.out.parent.mkdir(exist_ok=True)
    cv2.imwrite(str(arguments.out), sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])
    print(f"{arguments.out}: rows {', '.join(PLACES)}, corner; columns source, {', '.join(map(str, frames))}")


def solved(clip: Path) -> Solve:
    code = store.digest(store.sources(*store.SOLVER))
    work = store.FOLDER / "solves" / f"duck-{code}.aperture"
    SolveProcess(clip, work).wait()
    return load_solve(work)


def rendered(solve: Solve, step: int) -> dict[int, Pixels]:
    """(H, W, 3) sRGB frames by number."""
    folder = store.FOLDER / "duck" / store.digest(store.sources("addon/core", "addon/render"))
    command = [sys.executable, "-m", "addon.headless", "render", str(solve.work_dir), "--focus-at", FOCUS]
    first, last = int(solve.reconstruction.frames[0]), int(solve.reconstruction.frames[-1])
    lens = ["--blur", str(BLUR), "--frames", f"{first}-{last}:{step}", "--out", f"{folder}/####.png"]
    subprocess.run([*command, *lens], check=True, cwd=store.ROOT)
    found: dict[int, Pixels] = {}
    for path in sorted(folder.glob("[0-9]*.png")):
        bgr = cv2.imread(str(path))
        assert bgr is not None
        found[int(path.stem)] = np.asarray(bgr[..., ::-1], np.uint8)
    return {frame: found[frame] for frame in range(first, last + 1, step)}


def row(rec: Reconstruction, source: Pixels, place: tuple[float, float], frames: dict[int, Pixels]) -> Pixels:
    """(SIZE, n SIZE, 3) crops around a place of the scene."""
    focus = pick(rec, MIDDLE, *place)
    crops = [cropped(source, seen(rec, focus, MIDDLE))]
    return np.hstack(crops + [cropped(picture, seen(rec, focus, frame)) for frame, picture in frames.items()])


def seen(rec: Reconstruction, focus: Focus, frame: int) -> Floats:
    """(2,) pixels where a frame sees the middle of the points."""
    image, _ = rec.image_at(frame)
    local = image.to_camera(rec.points.xyz[list(focus.points)].mean(axis=0)[None])
    return np.asarray(rec.intrinsics(image).project(local)[0], np.float64)


def cropped(picture: Pixels, at: Floats) -> Pixels:
    """(SIZE, SIZE, 3) around a place, as near to it as the border allows."""
    height, width = picture.shape[:2]
    left, top = np.clip(np.rint(at - SIZE / 2), 0, [width - SIZE, height - SIZE]).astype(int)
    return np.ascontiguousarray(picture[top : top + SIZE, left : left + SIZE])


if __name__ == "__main__":
    main()
