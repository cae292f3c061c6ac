import bpy

# Fast and soft wide open: glowing rims, comets in the corners.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.spherical_aberration = 0.5
shape.vignetting = 0.55
shape.axial_colour = 0.03
shape.swirl = 0.1
shape.coma = 0.15
shape.breathing = 1.0
settings.highlights = 1.0
settings.f_stop = 1.2
