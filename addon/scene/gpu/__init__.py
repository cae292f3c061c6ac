"""Work on Blender's main thread, and the plane sweep on a GPU."""
