import bpy

# A triplet with its light at the rim, as the Trioplan has it.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.spherical_aberration = 0.9
shape.vignetting = 0.3
settings.highlights = 1.0
settings.f_stop = 2.8
