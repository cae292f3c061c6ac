import bpy

# A portrait lens of two achromats: the background turns about the middle, and corners are soft.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.spherical_aberration = 0.2
shape.vignetting = 0.5
shape.axial_colour = 0.01
shape.swirl = 0.9
shape.field_curvature = 0.3
shape.coma = 0.1
shape.breathing = 1.0
settings.highlights = 1.0
settings.f_stop = 1.9
