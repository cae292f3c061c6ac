"""Warp meshes: a frame as textured triangles with inverse depth, and its hidden surfaces."""
