"""Meshers, which make the warp mesh of a frame: each is a module here and a line below."""

from . import features, layers, thesis

MESHERS = {module.MESHER.name: module.MESHER for module in (layers, features, thesis)}
"""Meshers by name, the default first."""
