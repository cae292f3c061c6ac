import bpy

# Straight edges, a corner upwards. The amount of blur stays.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.blades = 6
settings.highlights = 1.0
