"""Cost and views at equal error on the same mesh: a part of `python -m benchmarks.timings.speed`.

The layered mesh of a scene's first judged frame with its true depth. Cycles' thin lens draws the unfiltered
texture with a number of samples; what it misses of a converged picture of its own is half of what two seeds
differ by, squared. Ours is compared with 512 plain views. Costs are CPU seconds of drawing, for ours with the
prefilter; the mesh is made before. Errors are PSNR in dB of sRGB values, over the whole frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from addon.core.base.arrays import Floats
from addon.core.frame.frame import Frame
from addon.core.optics.aperture_sampling import exact_registration, random_disc, vogel_disc

from ..accuracy.methods import thin_lens
from ..accuracy.metrics import psnr
from ..accuracy.scenes import Picture
from ..cost import measured
from .view_error import Scored, drawn

COUNTS = (4, 6, 8, 12, 16, 24, 32, 64)
"""Views of ours, between which costs are interpolated."""
SEEDS = 4
"""Of random positions, whose squared errors are averaged."""
RANDOM = 64
"""Random views whose error is measured; that of others is as one over their number."""


def table(scenes: list[str], blur: int, samples: list[int]) -> str:
    """Markdown: Cycles against ours, and views against random ones."""
    scored = [Scored(name, blur) for name in scenes]
    lines = [
        f"Largest disc {blur} px.", "",
        "| scene | Cycles, samples | its error, dB | CPU s | ours at that error: views | CPU s | Cycles over"
        " ours |",
        "|---|---|---|---|---|---|---|",
        *(line for one in scored for line in against_cycles(one, samples)), "",
        "| scene | views | plain, dB | random ones for it | prefiltered, dB | random ones for it |",
        "|---|---|---|---|---|---|",
        *(line for one in scored for line in against_random(one)), "",
    ]  # fmt: skip
    return "\n".join(lines)


def against_cycles(scored: Scored, samples: list[int]) -> list[str]:
    """A row for each number of samples: what ours takes for the same error, interpolated."""
    errors, costs = [], []
    for count in COUNTS:
        # Twice: other work on the machine only adds.
        runs = [measured(partial(_prefiltered, scored.meshed, count)) for _ in range(2)]
        errors.append(psnr(runs[0][0], scored.reference))
        costs.append(min(cost.cpu_s for _, cost in runs))
    # A number more may be a little worse by chance.
    best = np.maximum.accumulate(errors)
    lines = []
    for count in samples:
        draw = partial(thin_lens, scored.meshed, count)
        (one, cost), (other, _) = measured(partial(draw, seed=1)), measured(partial(draw, seed=2))
        error = psnr(one, other) + 10 * np.log10(2)
        if error > best[-1]:
            lines.append(f"| {scored.name} | {count} | {error:.1f} | {cost.cpu_s:.2f} | - | - | - |")
            continue
        views, own = (np.exp(np.interp(error, best, np.log(each))) for each in (COUNTS, costs))
        few = "at most " if error < best[0] else ""
        lines.append(
            f"| {scored.name} | {count} | {error:.1f} | {cost.cpu_s:.2f} | {few}{views:.0f} | {own:.2f} |"
            f" {cost.cpu_s / own:.0f} |"
        )
    return lines


def against_random(scored: Scored) -> list[str]:
    """A row for each number of views: how many random positions have the same error."""
    meshed, reference = scored.meshed, scored.reference
    squared = [_squared(at(meshed, partial(random_disc, RANDOM, s)), reference) for s in range(SEEDS)]
    once, lines = RANDOM * float(np.mean(squared)), []
    for count in (each for each in COUNTS if each <= 32):
        plain = _squared(at(meshed, partial(vogel_disc, count)), reference)
        filtered = _squared(_prefiltered(meshed, count), reference)
        cells = [
            f"{-10 * np.log10(each):.1f} | {once / each:.0f} ({once / each / count:.1f} times)"
            for each in (plain, filtered)
        ]
        lines.append(f"| {scored.name} | {count} | {' | '.join(cells)} |")
    return lines


def at(meshed: Frame, disc: Callable[[], Floats]) -> Picture:
    """(H, W, 3) a frame with its texture as it is, through views at positions (n, 2) on the unit disc."""
    offsets = meshed.lens.radius * disc()
    warped = meshed.through(1, prefiltered=False)
    registration = exact_registration(warped.views.canvas, offsets, warped.views.lens.focus)
    return drawn(replace(warped, views=replace(warped.views, offsets=offsets, registration=registration)))


def _prefiltered(meshed: Frame, count: int) -> Picture:
    return drawn(meshed.through(count))


def _squared(one: Picture, other: Picture) -> float:
    return float(10 ** (-psnr(one, other) / 10))
