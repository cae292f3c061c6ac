import bpy

# Its secondary mirror makes rings of discs.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.obstruction = 0.45
settings.highlights = 1.0
settings.f_stop = 8.0
