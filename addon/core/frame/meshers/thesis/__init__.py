"""The warp meshes of the 2010 thesis: its own method, and the two of its further work (section 5.2)."""
