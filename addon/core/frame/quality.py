"""Draft, normal and final: presets of the cost of a frame's depth, mesh and views.

Each is on the plot of error over CPU seconds (`python -m benchmarks.accuracy.envelope`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from ..depth.map_fusion import FusionOptions
from ..depth.multi_view_stereo import COARSE, LONG_SIDE
from ..warp.layered_mesh import LARGEST_TEXTURE


@dataclass(frozen=True)
class Quality:
    """A preset of options; `QUALITIES` lists all."""

    name: str
    """Name on the command line and, in capitals, in .blend files."""
    number: int
    """Number of the enumeration's item in .blend files: never used twice."""
    help: str
    """Text in the interface and on the command line, one sentence without a full stop."""
    views: float = 1.0
    """Factor to the automatic number of views."""
    longest: int = 960
    """Most pixels of the long side at which it is drawn with dense depth; detail in focus is the source's.
    Four of five real clips differ by 45.9 to 55.7 dB from their own size (`benchmarks.special
    drawn_size` at 010ab4e6)."""
    stereo_side: int = LONG_SIDE
    """Pixels of the longer side at which stereo finds the depth of key frames."""
    fusion: FusionOptions = field(default_factory=FusionOptions)
    """Fusion of depth over time, and choice of key frames."""
    largest_texture: int = LARGEST_TEXTURE
    """Most texels of a texture finer than the picture."""
    better: Quality | None = None
    """The quality whose stored depth is preferred."""
    finds_subjects: bool = True
    """True if moving objects are searched and depth is stored."""

    def drawn_size(self, size: tuple[int, int], has_cg: bool = False) -> tuple[int, int]:
        """Return the (width, height) at which a frame of a size is drawn.

        With CG objects `longest` counts in drafts alone: the source has no detail for them.
        """
        times = 1 if has_cg and self.better is None else math.ceil(max(size) / self.longest)
        return math.ceil(size[0] / times), math.ceil(size[1] / times)


NORMAL = Quality("normal", 1, "Recommended")
DRAFT = Quality(
    "draft", 0, "A quick look: half the views, and coarser depth",
    views=0.5, stereo_side=480, largest_texture=0, better=NORMAL,
)  # fmt: skip
"""From the video alone (`make bench`, 24 px): 38.7, 42.9, 35.9 and 31.2 dB on boxes, walk, rack and bars
for 0.52 to 0.56 CPU s; the classical scatter: 37.4, 41.8, 31.0 and 26.9 for 0.23 to 0.35."""
FAIR_LOOK = replace(DRAFT, name="fair look", help="Shown while a picture is made", longest=480)
"""Internal: shown before a picture of the scene's quality."""
FIRST_LOOK = replace(
    FAIR_LOOK, name="first look", help="From neighbouring frames alone, shown while depth is found",
    stereo_side=COARSE, fusion=FusionOptions(step=1, sides=0), finds_subjects=False,
)  # fmt: skip
"""Internal: shown before a frame's depth is known."""
FINAL = Quality(
    "final", 2, "Twice the views, and depth found from scratch in every frame",
    views=2.0, longest=3840, fusion=FusionOptions(most_unseen=-1.0),
)  # fmt: skip
"""From the video alone at 32 pixels fence, with a moving object that neighbours hardly see, has 33.64 instead
of 33.00 dB, 31.82 instead of 31.11 at edges (a scratch script); bars and walk are unchanged. Twice normal's
time to find depth."""
QUALITIES = {quality.name: quality for quality in (DRAFT, NORMAL, FINAL)}
