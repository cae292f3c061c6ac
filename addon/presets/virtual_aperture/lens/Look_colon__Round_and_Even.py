import bpy

# What a thin lens does. The amount of blur stays.
settings = bpy.context.scene.virtual_aperture
settings.highlights = 1.0
