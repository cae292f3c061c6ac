"""The shop through a lens of 0.24 m, no margin cut off: `python -m benchmarks.special shop_table`.

True cameras; depth is the scene's own (a sweep over more views than a clip has) or found from the clip's 34
frames. The truth of a pixel is the mean of those of the disc's views that see it. PSNR at gamma 2.2.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from .cases import GroundTruth
from .methods import METHODS
from .scenes import Picture
from .shop import FOCAL, FOCUS, HEIGHT, RADII, WIDTH, Shop

VIEWS = 256
MARGIN = 60
"""Pixels a side, for a second figure."""
WANTED = {"shop5": 42.0, "shop8": 38.0, "shop20": 42.0}


def main() -> None:
    print("| focus, m | depth | dB, whole frame | dB, without a margin of 60 px | wanted | thesis 256 |")
    print("|---|---|---|---|---|---|")
    for name in FOCUS:
        scene = Shop.open(name)
        if isinstance(scene, str):
            raise SystemExit(scene)
        blur = scene.blurs[RADII.index(0.24)]
        frame = scene.judged(blur)[0]
        known = GroundTruth(scene)
        case, true = known.case(frame, blur), truth(scene, frame)
        baseline = psnr(METHODS["thesis"].run(case, VIEWS).picture, true)
        found = replace(case, clip=known.whole)
        for said, some in (("the scene's", case), ("of the clip", found)):
            picture = METHODS["layers"].run(some, VIEWS).picture
            inner = psnr(picture[MARGIN:-MARGIN, MARGIN:-MARGIN], true[MARGIN:-MARGIN, MARGIN:-MARGIN])
            whole = f"{psnr(picture, true):.2f} | {inner:.2f} | {WANTED[name]:g} | {baseline:.2f}"
            print(f"| {FOCUS[name]:g} | {said} | {whole} |", flush=True)


def truth(scene: Shop, frame: int) -> Picture:
    """(H, W, 3) linear: of each pixel the mean of the views that see it."""
    total, count = np.zeros((HEIGHT, WIDTH, 3)), np.zeros((HEIGHT, WIDTH, 1))
    for view in scene.disc(frame, 0.24):
        depth = FOCUS[scene.name]
        x, y = (scene.places[view] - scene.places[scene.path[frame - 1]]) * FOCAL / depth
        inside = cv2.warpAffine(
            np.ones((HEIGHT, WIDTH), np.uint8), np.array([[1, 0, x], [0, 1, y]]), (WIDTH, HEIGHT),
            flags=cv2.INTER_NEAREST,
        )[..., None]  # fmt: skip
        total += inside * scene.registered(frame, view, depth)
        count += inside
    return np.asarray(total / np.maximum(count, 1), np.float32)


def psnr(picture: Picture, true: Picture) -> float:
    error = np.clip(picture, 0, 1) ** (1 / 2.2) - np.clip(true, 0, 1) ** (1 / 2.2)
    return float(-10 * np.log10(np.mean(error**2)))


if __name__ == "__main__":
    main()
