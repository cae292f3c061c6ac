"""Views of a warp mesh, drawn and averaged by Blender's GPU module."""
