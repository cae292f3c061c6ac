import bpy

# A squeeze of 2: discs are twice as high as wide, and cut towards the corners.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.ratio = 2.0
shape.vignetting = 0.3
settings.highlights = 1.0
settings.f_stop = 2.0
