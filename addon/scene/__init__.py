"""The reconstruction as Blender data: camera, point cloud, virtual cameras, settings."""
