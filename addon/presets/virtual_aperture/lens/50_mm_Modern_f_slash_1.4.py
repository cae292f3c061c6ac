import bpy

# Corrected as today: even discs, cut a little toward the corners.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.vignetting = 0.3
shape.breathing = 0.15
settings.highlights = 1.0
settings.f_stop = 1.4
