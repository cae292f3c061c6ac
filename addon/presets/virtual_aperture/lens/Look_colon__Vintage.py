import bpy

# An old fast lens wide open: bright rims, magenta and green fringes, cat's eyes. The amount of blur stays.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape

shape.blades = 0
shape.rotation = 0.0
shape.roundness = 0.0
shape.ratio = 1.0
shape.obstruction = 0.0
shape.apodisation = 0.0
shape.spherical_aberration = 0.4
shape.vignetting = 0.5
shape.axial_colour = 0.04
shape.image = ""
settings.highlights = 1.0
