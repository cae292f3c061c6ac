import bpy

# An old fast lens wide open: bright rims, magenta and green fringes, cat's eyes. The amount of blur stays.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.spherical_aberration = 0.4
shape.vignetting = 0.5
shape.axial_colour = 0.04
settings.highlights = 1.0
