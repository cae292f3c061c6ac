"""Ways to make the warp mesh of a frame: a new one is a file here and a line below."""

from __future__ import annotations

from . import edges, features, grid, layers, thesis

MESHERS = {
    module.MESHER.name: module.MESHER
    for module in (
        layers,
        features,
        thesis,
        grid,
        edges,
    )
}
"""By name, the default first."""
