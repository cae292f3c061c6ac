"""Draft, normal and final: presets of the cost of a frame's depth, mesh and views.

Each is on the plot of error over CPU seconds (`python -m benchmarks.accuracy.envelope`).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from ..depth.map_fusion import FusionOptions
from ..depth.multi_view_stereo import COARSE, StereoOptions
from ..warp.layered_mesh import LayeredMeshOptions


@dataclass(frozen=True)
class Quality:
    """Options that are chosen together; `QUALITIES` lists all of them."""

    name: str
    """On the command line and, in capitals, in .blend files."""
    number: int
    """In .blend files, where Blender keeps the number of an enumeration's item: never used twice."""
    help: str
    """In the interface and on the command line, one sentence without a full stop."""
    views: float = 1.0
    """Times the automatic number of views."""
    shrink: int = 1
    """Times that the picture is smaller, in each direction, that depth of every pixel is drawn on."""
    stereo: StereoOptions = field(default_factory=StereoOptions)
    """How the depth of a key frame is found."""
    fusion: FusionOptions = field(default_factory=FusionOptions)
    """How depth is steadied and which frames are key frames."""
    mesh: LayeredMeshOptions = field(default_factory=LayeredMeshOptions)
    """How layers are triangulated and painted."""
    better: Quality | None = None
    """Whose depth is taken instead where it is kept already."""
    finds_subjects: bool = True
    """Whether what moves by itself is looked for, and depth is kept."""

    def drawn_size(self, size: tuple[int, int]) -> tuple[int, int]:
        """Size (width, height) that a frame of a size is drawn at."""
        return -(-size[0] // self.shrink), -(-size[1] // self.shrink)


NORMAL = Quality("normal", 1, "Recommended")
DRAFT = Quality(
    "draft", 0, "A quick look: drawn at half size, with full sharpness where in focus",
    views=0.5, shrink=2, stereo=StereoOptions(long_side=480), mesh=LayeredMeshOptions(largest_texture=0),
    better=NORMAL,
)  # fmt: skip
"""A quarter of normal's time to draw, and a third with depth to find (`python -m benchmarks.timings.speed`),
for 0.7, 2.6 and 1.4 dB on bars, fence and walk with true depth at 32 pixels (`python -m
benchmarks.accuracy.envelope`; fence by a scratch script)."""
FIRST_LOOK = replace(
    DRAFT, name="first look", help="From neighbouring frames alone, shown while depth is found",
    stereo=COARSE, fusion=FusionOptions(step=1, sides=0), finds_subjects=False,
)  # fmt: skip
"""No choice of the user's: what is seen before a frame's depth is known."""
FINAL = Quality(
    "final", 2, "Twice the views, and depth found from scratch in every frame",
    views=2.0, fusion=FusionOptions(most_unseen=-1.0),
)  # fmt: skip
"""From the video alone at 32 pixels fence, with a moving object that neighbours see badly, has 33.64 instead
of 33.00 dB, 31.82 instead of 31.11 at edges (a scratch script); bars and walk have as much as before. Twice
normal's time to find depth."""
QUALITIES = {quality.name: quality for quality in (DRAFT, NORMAL, FINAL)}
