import bpy

# Its secondary mirror makes rings of discs.
settings = bpy.context.scene.virtual_aperture
settings.property_unset("shape")
shape = settings.shape
shape.obstruction = 0.45
settings.highlights = 1.0
# Beyond all distances, focused at 10 m: f^2 / (N (s - f)) of a full frame's 36 mm.
settings.blur = 0.0914
# Counts where the scene's scale is known.
settings.f_stop = 8.0
