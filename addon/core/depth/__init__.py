"""Depth of a frame: of sparse features, of the user's maps, or of multi-view stereo fused over time."""
