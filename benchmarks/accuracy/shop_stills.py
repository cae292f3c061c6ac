"""The shop as photos in no order: `python -m benchmarks.special shop_stills [shop5 shop8 shop20]`.

True cameras, the middle view through a lens of 0.24 m. Depth and hidden colours come from one row of the
light field (17 views), or from every second view of every second row (81, a quarter); beside them the true
depth with the quarter's colours. PSNR at gamma 2.2, whole frame, as `shop_table`.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cached_property
from pathlib import Path

from addon.core.camera.reconstruction import Reconstruction

from .. import store
from .cases import GroundTruth
from .methods import METHODS
from .shop import FOCUS, RADII, Shop
from .shop_table import VIEWS, psnr, truth

ROW = tuple((13, column) for column in range(5, 22))
QUARTER = tuple((row, column) for row in range(5, 22, 2) for column in range(5, 22, 2))


class Photos(Shop):
    """Some views of the shop, none before another."""

    def __init__(self, name: str, folder: Path, views: tuple[tuple[int, int], ...]) -> None:
        super().__init__(name, folder)
        self._views = views

    @cached_property
    def key(self) -> str:
        return store.digest([path.name for path in self.files.values()], repr(self._views))

    @cached_property
    def path(self) -> tuple[tuple[int, int], ...]:
        return self._views

    @cached_property
    def cameras(self) -> Reconstruction:
        return replace(super().cameras, is_ordered=False)

    def clip(self) -> Path:
        folder = store.FOLDER / f"shop-{len(self._views)}-photos"
        folder.mkdir(parents=True, exist_ok=True)
        for frame, view in enumerate(self._views, start=1):
            link = folder / f"frame_{frame:04d}.jpg"
            if not link.exists():
                link.symlink_to(self.files[view].resolve())
        return folder


def main() -> None:
    print("| focus, m | one row | a quarter | true depth, colours of the quarter |")
    print("|---|---|---|---|")
    for name in sys.argv[1:] or list(FOCUS):
        scene = Shop.open(name)
        if isinstance(scene, str):
            raise SystemExit(scene)
        figures = []
        for views in (ROW, QUARTER):
            photos = Photos(name, next(iter(scene.files.values())).parent, views)
            known, frame = GroundTruth(photos), views.index((13, 13)) + 1
            case, true = known.case(frame, photos.blurs[RADII.index(0.24)]), truth(photos, frame)
            found = METHODS["layers"].run(replace(case, clip=known.whole), VIEWS).picture
            figures.append(psnr(found, true))
        figures.append(psnr(METHODS["layers"].run(case, VIEWS).picture, true))
        print(f"| {FOCUS[name]:g} | " + " | ".join(f"{each:.2f}" for each in figures) + " |", flush=True)


if __name__ == "__main__":
    main()
