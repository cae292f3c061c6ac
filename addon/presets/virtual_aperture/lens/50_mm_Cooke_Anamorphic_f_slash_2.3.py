import bpy

# A squeeze of 2, whose cylinder focuses a little nearer, behind a matte box.
settings = bpy.context.scene.virtual_aperture
shape = settings.shape
shape.ratio = 2.0
shape.vignetting = 0.3
shape.anamorphic_focus = 0.06
shape.lateral_colour = 0.0008
shape.matte_box_sides = 0.25
shape.breathing = 0.25
settings.highlights = 1.0
settings.f_stop = 2.3
