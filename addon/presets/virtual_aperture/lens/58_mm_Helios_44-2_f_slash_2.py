import bpy

# Cat's eyes that turn about the middle, wide open: its eight blades are out of the way.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.spherical_aberration = 0.3
shape.vignetting = 0.7
shape.axial_colour = 0.02
shape.swirl = 0.35
shape.field_curvature = 0.15
shape.coma = 0.08
shape.breathing = 1.0
settings.highlights = 1.0
settings.f_stop = 2.0
