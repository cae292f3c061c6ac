"""The reconstruction in the .blend: cameras, point cloud, and its exact numbers."""
