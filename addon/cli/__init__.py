"""The command line: `headless.py` and `blender --command virtual_aperture`."""
