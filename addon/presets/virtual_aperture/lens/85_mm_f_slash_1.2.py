import bpy

# Wide open and corrected for soft rims, as portrait lenses are.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.spherical_aberration = -0.2
shape.vignetting = 0.5
settings.highlights = 1.0
settings.f_stop = 1.2
