"""Warp meshes: a frame as textured triangles with inverse depth, and what its silhouettes hide."""
