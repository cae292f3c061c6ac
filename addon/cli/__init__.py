"""The command line: `headless.py` and `blender --command virtual_aperture`."""

NAME = "virtual_aperture"
"""Name of the command of an installed extension: `blender --command virtual_aperture`."""
