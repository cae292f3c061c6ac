"""Common code of the scene: timeline, paths, preferences, versions, redrawing."""
