"""Lists and overlays of focus marks and subjects, and presets of the lens."""
