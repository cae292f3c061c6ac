import bpy

# Wide open: the blades do not show, the barrel cuts discs in the corners.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.spherical_aberration = 0.1
shape.vignetting = 0.4
settings.highlights = 1.0
settings.f_stop = 1.4
