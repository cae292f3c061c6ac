"""The lens of a scene: its settings, depth of field, aperture shape, and Blender's own focus."""
