"""Settings of the clip: its path, lens, masks, depth maps, and the frames of its solve."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from ..core.media.fixed_area import FIXED
from ..core.media.picture_tags import MOST_ASPECT
from .base.option_properties import hidden, path_property, property_of
from .lens_properties import aperture_changed
from .sources import colour_space, hdr_view
from .sources.subjects import VirtualApertureSubjects


def _space_changed(settings: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    hdr_view.follow(settings.id_data)
    aperture_changed(settings, context)


class ClipProperties:
    """The clip."""

    footage: path_property("Clip", "Video file, image folder, or a pattern such as shot_####.png")
    work_dir: path_property(
        "Working Folder",
        "Folder for the solve. Leave empty to keep it next to the .blend, named after the clip,"
        " or in the Cache Folder of the preferences",
        subtype="DIR_PATH",
    )
    stills: BoolProperty(
        name="Unordered Photos",
        description="The images are photos taken from different places, not a clip. Each one is matched"
        " with every other",
    )
    lens: EnumProperty(
        name="Lens",
        description="What is known about the clip's focal length",
        items=[
            ("FIND", "From the Clip", "Estimate the focal length from the clip", 0),
            ("GIVEN", "35 mm Equivalent", "Known and constant, as a 35 mm equivalent", 1),
            ("SENSOR", "Lens and Sensor", "Known and constant, along with the sensor width", 3),
            ("ZOOM", "Zoom Lens", "The focal length changes during the clip", 2),
        ],
    )
    equivalent: FloatProperty(
        name="Focal Length",
        description="35 mm equivalent in millimeters, as phones and cameras report it",
        min=1.0,
        soft_max=400.0,
        default=26.0,
    )
    focal_mm: FloatProperty(
        name="Focal Length",
        description="Focal length as marked on the lens",
        subtype="DISTANCE_CAMERA",
        min=0.1,
        soft_max=400.0,
        default=35.0,
    )
    sensor_mm: FloatProperty(
        name="Sensor Width",
        description="Width of the sensor area the clip was recorded with",
        subtype="DISTANCE_CAMERA",
        min=0.1,
        soft_max=70.0,
        default=36.0,
    )
    pixel_aspect: FloatProperty(
        name="Pixel Aspect",
        description="Width of a pixel divided by its height, such as 2 where a lens squeezed the picture to"
        " half its width. 0: what the file says, else 1",
        min=0.0,
        max=MOST_ASPECT,
    )
    depth_maps: path_property(
        "Depth Maps",
        "Your own depth maps: a folder of EXR, 16-bit PNG or .npz files, or a single .npz or"
        " .zip. Depth, inverse depth or disparity at any scale; the feature points settle which. A depth"
        " network (.onnx) is run on the clip. Leave empty to use depth found from the clip alone",
        update=aperture_changed,
    )
    colour_space: StringProperty(
        name="Color Space",
        description="What the clip was recorded in, such as S-Log3 S-Gamut3.Cine: cameras that record a log"
        " rarely say so in the file. Empty: what the file says, else sRGB",
        search=lambda _settings, _context, _typed: colour_space.names(),
        update=_space_changed,
    )
    masks: path_property(
        "Masks",
        "Mattes of moving objects: a folder, or one image of a sequence. White or opaque moves,"
        " gray moves in part. Leave empty to rely on what is found in the clip",
    )
    mask: PointerProperty(
        type=bpy.types.Mask,
        name="Drawn Mask",
        description="Mask drawn around moving objects in the Image or Movie Clip Editor, feather included."
        " Tracks that drive its points are ignored",
    )
    segmenter: path_property(
        "Segmenter",
        "Salient-object network of your own (.onnx), such as IS-Net or U2-Net, that cuts any object out of"
        " the clip from a click or a stroke. Leave empty to recognize people and moving objects alone",
    )
    fixed: property_of(FIXED, aperture_changed)
    subjects: PointerProperty(
        type=VirtualApertureSubjects, name="Subjects", description="Moving subjects marked by strokes"
    )
    clip_identity: hidden(StringProperty, "Identity", "Fingerprint of the solved clip")
    clip_name: hidden(StringProperty, "Name", "Name of the solved clip")
    solved_in: hidden(StringProperty, "Solved In", "Working folder of the solve")
    clip_notes: hidden(StringProperty, "Notes", "Remarks about the solved clip, one per line")
    clip_first: hidden(IntProperty, "First Frame", "First solved frame")
    clip_last: hidden(IntProperty, "Last Frame", "Last solved frame")
    clip_pixel_aspect: hidden(FloatProperty, "Pixel Aspect", "Pixel aspect the clip was solved with")
    clip_step: hidden(IntProperty, "Frame Step", "Step from one solved frame to the next", default=1)
