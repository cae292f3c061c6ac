"""Pictures for the extension's page in a store, of those that the documentation has.

    python -m sample_scenes.store_pictures [--out docs/store]

The featured picture is the sample clip as it was filmed, and with focus on the mug, the globe and the plant;
the icon is the globe. Both are parts of pictures by `make demo` and `make moving-picture`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np

from .demo import ROOT, Frames

WIDTH, HEIGHT, ICON = 1920, 1080, 256
GLOBE = slice(70, 290), slice(225, 445)
"""Rows and columns of the globe in its picture."""
BORDER = 4
"""Pixels between two pictures."""
QUALITY = 90
"""JPEG's, of 100: half a megabyte."""


def pictures(docs: Path) -> list[Frames]:
    """Return the source, and it with focus on the mug, the globe and the plant: (H, W, 3), blue first."""
    source, globe = np.split(np.asarray(cv2.imread(str(docs / "side_by_side.jpg")), np.uint8), 2, axis=1)
    _, pull = cv2.imreadanimation(str(docs / "focus_pull.webp"))
    # It ends at the mug again: the plant is in focus half way.
    return [
        source,
        *(np.asarray(each, np.uint8)[..., :3] for each in (pull.frames[0], globe, pull.frames[35])),
    ]


def tiled(parts: list[Frames]) -> Frames:
    """Return four pictures as one of the size of a featured picture."""
    size = (WIDTH - BORDER) // 2, (HEIGHT - BORDER) // 2
    found = np.full((HEIGHT, WIDTH, 3), 235, np.uint8)
    for number, part in enumerate(parts):
        row, column = number // 2 * (size[1] + BORDER), number % 2 * (size[0] + BORDER)
        large = cv2.resize(part, size, interpolation=cv2.INTER_CUBIC)
        found[row : row + size[1], column : column + size[0]] = large
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "store")
    out: Path = parser.parse_args().out
    parts = pictures(ROOT / "docs")
    out.mkdir(parents=True, exist_ok=True)
    icon = cv2.resize(parts[2][GLOBE], (ICON, ICON), interpolation=cv2.INTER_CUBIC)
    cv2.imwrite(str(out / "featured.jpg"), tiled(parts), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    cv2.imwrite(str(out / "icon.png"), icon)
    print(out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
