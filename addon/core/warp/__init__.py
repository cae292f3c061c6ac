"""Warp meshes: a frame as textured triangles with inverse depth, and the surfaces behind its silhouettes."""
