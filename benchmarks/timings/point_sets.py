"""Point sets of the aperture and splats of its views: `python -m benchmarks.special point_sets`.

A scene's first judged frame with its true depth, drawn by the product's own views at four sets of N
positions: uniformly random ones (the thesis's); Vogel's spiral; a hexaweb, rings of 6, 12, 18, ... positions
around one, as in the concentric lattices of optical design and of real-time bokeh; and the centroids of equal
shares by Lloyd's iteration, which the product uses.

Each is drawn with three textures: as it is; with each view splatted over its share of the aperture, a disc of
1 / sqrt(N) of the radius, which is the product's prefilter; and with a soft splat of an eighth of the
aperture for any N, two discs one after the other with the variance of one of an eighth of the radius.
Positions are scaled so that their variance and the splat's add up to the disc's. Scores are PSNR in dB of
sRGB values over the whole frame, against the mean of `REFERENCE` views by themselves.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np

from addon.core.base.arrays import Floats, LinearRGBA
from addon.core.frame.warped_frame import MeshedFrame
from addon.core.optics.aperture_sampling import centroidal_disc, exact_registration, random_disc, vogel_disc
from addon.core.warp.footprint import prefilter

from .. import store
from ..accuracy.metrics import psnr
from ..accuracy.scenes import Picture, Short
from .view_error import Scored, drawn

REFERENCE = 4096
"""Views by themselves that stand for infinitely many."""
EIGHTH = 64
"""Views whose share is a disc of an eighth of the aperture's radius."""
SEED = 1
RESULTS = store.ROOT / "benchmarks" / "results" / "point_sets.md"


def hexaweb(count: int) -> Floats:
    """(n, 2) one position and rings of 6, 12, 18, ... around it, in the centroids of equal shares.

    Whole rings alone have equal shares: n is 7, 19, 37, 61, ...
    """
    positions, inner = [np.zeros((1, 2))], 1
    for ring in range(1, count):
        if inner >= count:
            break
        low, high = np.sqrt(inner / count), np.sqrt((inner + 6 * ring) / count)
        half = np.pi / (6 * ring)
        radius = 2 / 3 * (high**3 - low**3) / (high**2 - low**2) * np.sin(half) / half
        angle = 2 * half * np.arange(6 * ring)
        positions.append(radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        inner += 6 * ring
    assert inner == count, f"a hexaweb has no {count} positions"
    return np.concatenate(positions)


SETS: dict[str, Callable[[int], Floats]] = {
    "random": partial(random_disc, seed=SEED),
    "Vogel": vogel_disc,
    "hexaweb": hexaweb,
    "Lloyd": centroidal_disc,
}
SPLATS: dict[str, Callable[[int], tuple[int, ...]]] = {
    "none": lambda count: (),
    "D / sqrt(N)": lambda count: (count,),
    "soft, 1/8": lambda count: (2 * EIGHTH, 2 * EIGHTH),
}
"""Numbers of views over whose shares the texture is blurred, one after the other."""


@dataclass(frozen=True)
class ScoredShort(Scored):
    """A scene as `make bench` films it."""

    @cached_property
    def scene(self) -> Short:  # type: ignore[override]
        return _filmed(self.name)


@lru_cache
def _filmed(name: str) -> Short:
    """A scene, which is built once for all of its blurs."""
    return Short(name)


def splatted(meshed: MeshedFrame, shares: tuple[int, ...]) -> LinearRGBA:
    """The frame's texture (h, w, 4), blurred over the shares of numbers of views."""
    texture, lens = meshed.surface.texture.copy(), meshed.geometry.lens
    for count in shares:
        prefilter(texture, meshed.surface.layers, lambda d, n=count: lens.footprint(d, n))  # type: ignore[misc]
    return texture


def through(meshed: MeshedFrame, texture: LinearRGBA, positions: Floats, shares: tuple[int, ...]) -> Picture:
    """(H, W, 3) the frame through views at positions (N, 2), with its texture blurred over shares."""
    left = max(0.0, 1 - sum(1 / count for count in shares))
    spread = 2 * np.mean((positions**2).sum(axis=1))
    offsets = meshed.geometry.lens.radius * np.sqrt(left / spread) * positions
    warped = meshed.through(1, prefiltered=False)
    registration = exact_registration(warped.plan.canvas, offsets, warped.plan.lens.focus)
    plan = replace(warped.plan, offsets=offsets, registration=registration, weights=None)
    return drawn(replace(warped, plan=plan, texture=texture))


def compare(scored: Scored, counts: list[int]) -> dict[tuple[str, str], list[float]]:
    """PSNR for each number of views, by point set and splat."""
    meshed = scored.meshed
    reference = through(meshed, meshed.surface.texture, vogel_disc(REFERENCE), ())
    scores: dict[tuple[str, str], list[float]] = {(each, how): [] for each in SETS for how in SPLATS}
    for count in counts:
        for how, shares in SPLATS.items():
            texture = splatted(meshed, shares(count))
            for each, positions in SETS.items():
                picture = through(meshed, texture, positions(count), shares(count))
                scores[each, how].append(psnr(picture, reference))
    return scores


def shown(scores: dict[tuple[str, str], list[float]], counts: list[int]) -> list[str]:
    """Rows of a table: PSNR, and the views for the error of the product's largest number but one."""
    ours = scores["Lloyd", "D / sqrt(N)"]
    lines = []
    for (each, how), found in scores.items():
        # A number more may be a little worse by chance.
        rising = np.maximum.accumulate(found)
        needed = np.exp(np.interp(ours[1], rising, np.log(counts)))
        sign = "over " if ours[1] > rising[-1] else "at most " if ours[1] < rising[0] else ""
        cells = " | ".join(f"{value:.1f}" for value in found)
        lines.append(f"| {each} | {how} | {cells} | {sign}{needed:.0f} |")
    return lines


def report() -> None:
    """Print the mean of the tables that are kept in `RESULTS`."""
    rows: dict[tuple[str, str], list[list[float]]] = {}
    head = ""
    for line in RESULTS.read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if cells[0] == "positions":
            head = f"| {' | '.join(cells[:-1])} |"
        elif cells[0] in SETS:
            rows.setdefault((cells[0], cells[1]), []).append([float(cell) for cell in cells[2:-1]])
    print(f"{head}\n{'|---' * (head.count('|') - 1)}|")
    for (each, how), found in rows.items():
        mean = " | ".join(f"{value:.1f}" for value in np.mean(found, axis=0))
        print(f"| {each} | {how} | {mean} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=["bars", "fence", "walk"])
    parser.add_argument("--blurs", nargs="+", type=int, default=[12, 24, 48], metavar="PX")
    parser.add_argument("--views", nargs="+", type=int, default=[7, 19, 37, 61])
    parser.add_argument("--report", action="store_true", help=f"the mean of {RESULTS.name} alone")
    options = parser.parse_args()
    if options.report:
        report()
        return
    counts = sorted(options.views)
    heads = " | ".join(f"{count} views" for count in counts)
    for blur in options.blurs:
        print(f"\nLargest disc {blur} px.\n")
        print(f"| positions | splat | {heads} | for the error of {counts[1]} of ours |")
        print("|---" * (3 + len(counts)) + "|")
        found = [compare(ScoredShort(name, blur), counts) for name in options.scenes]
        # The mean of PSNR over scenes, as that of `view_error`.
        mean = {key: np.mean([each[key] for each in found], axis=0).tolist() for key in found[0]}
        print("\n".join(shown(mean, counts)), flush=True)


if __name__ == "__main__":
    main()
