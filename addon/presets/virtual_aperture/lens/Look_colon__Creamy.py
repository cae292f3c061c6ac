import bpy

# Apodisation: discs have no rim. The amount of blur stays.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape

shape.blades = 0
shape.rotation = 0.0
shape.roundness = 0.0
shape.ratio = 1.0
shape.obstruction = 0.0
shape.apodisation = 0.8
shape.spherical_aberration = 0.0
shape.vignetting = 0.0
shape.axial_colour = 0.0
shape.image = ""
settings.highlights = 1.0
