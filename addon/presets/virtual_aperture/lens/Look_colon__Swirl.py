import bpy

# Cat's eyes about the middle. The amount of blur stays.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.vignetting = 0.9
settings.highlights = 1.0
