"""Drawing views, averaging them, and handing the result to Blender's own pipeline."""
