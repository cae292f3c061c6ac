import bpy

# Apodisation: discs have no rim. The amount of blur stays.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.apodisation = 0.8
settings.highlights = 1.0
