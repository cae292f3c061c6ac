"""The lens as a camera of Cycles: a custom camera in Open Shading Language, keyed over the scene's frames."""

import hashlib
import tempfile
from pathlib import Path

import bpy
import numpy as np

from ...core.base.arrays import Floats
from ...core.base.errors import UserError
from ...core.camera.reconstruction import Reconstruction
from ...core.frame.options import APERTURE_OPTIONS
from ..base.timeline import clip_frame
from ..sources.shot import reconstruction_of
from .lens import frame_options

NAME = "Virtual Aperture Lens"
"""Name of the camera and of its shader's text."""
SHADER = Path(__file__).with_name("lens_camera.osl")
KEYED = ("radius", "focus", "tilt_x", "tilt_y", "focal", "shift_x", "shift_y")
"""Parameters of the shader that may change over the clip."""
SHAPE = (
    "blades", "rotation", "roundness", "ratio", "obstruction", "apodisation", "spherical_aberration",
    "vignetting", "axial_colour",
)  # fmt: skip
"""Parameters of the shader that are those of `Aperture`."""
STEADY = 1e-6
"""Relative change up to which a parameter is constant: matrices and properties have single precision."""


def osl_problem() -> str:
    """Return the reason why Cycles cannot use a custom camera here; empty if it can."""
    try:
        import _cycles
    except ImportError:
        return "this Blender has no Cycles, which renders through the camera"
    if not _cycles.with_osl:
        return (
            "this Blender's Cycles was built without Open Shading Language (OSL), which custom cameras need;"
            " Blender from blender.org has it"
        )
    return ""


def add_lens_camera(scene: bpy.types.Scene) -> bpy.types.Object:
    """Add a camera to the scene with the clip's path and exactly this lens, or renew the one of before.

    Raises:
        UserError: Cycles has no OSL, or the lens has something that the shader lacks: an in-focus zone, or an
            image as its aperture.
    """
    if problem := osl_problem():
        raise UserError(problem)
    settings = scene.virtual_aperture
    reconstruction = reconstruction_of(settings)
    lens = frame_options(settings, reconstruction)
    if lens.zone.is_active:
        raise UserError("no camera has an in-focus zone; set In-Focus Zone back to that of a lens first")
    for name, known in APERTURE_OPTIONS.items():
        if name not in SHAPE and getattr(lens.aperture, name) != known.default:
            raise UserError(f"the camera's shader has no {known.label}; set it back first")
    camera = _camera(settings)
    _set_shader(camera.data)
    for name in SHAPE:
        camera.data.cycles_custom[name] = getattr(lens.aperture, name)
    _key(scene, camera.data, reconstruction)
    return camera


def _camera(settings: bpy.types.PropertyGroup) -> bpy.types.Object:
    """The camera of before, without keys, or a new one that follows the clip's."""
    own = settings.camera
    collection = own.users_collection[0]
    found = next((each for each in collection.objects if each.get(NAME)), None)
    if found is None:
        found = bpy.data.objects.new(NAME, bpy.data.cameras.new(NAME))
        found[NAME] = True
        collection.objects.link(found)
        found.constraints.new("COPY_TRANSFORMS").target = own
    found.data.animation_data_clear()
    for name in ("sensor_fit", "sensor_width", "clip_start", "clip_end", "display_size"):
        setattr(found.data, name, getattr(own.data, name))
    return found


def _set_shader(data: bpy.types.Camera) -> None:
    """Compile the shader into a camera: Blender itself compiles a text only where Cycles is the engine."""
    import _cycles

    text = bpy.data.texts.get(f"{NAME}.osl") or bpy.data.texts.new(f"{NAME}.osl")
    text.from_string(SHADER.read_text())
    with tempfile.TemporaryDirectory() as folder:
        compiled = Path(folder) / "lens.oso"
        if not _cycles.osl_compile(str(SHADER), str(compiled)):
            raise UserError("Cycles could not compile the camera's shader; the console shows why")
        code = compiled.read_text()
    data.type, data.custom_mode, data.custom_shader = "CUSTOM", "INTERNAL", text
    data.custom_bytecode = code
    data.custom_bytecode_hash = hashlib.md5(code.encode(), usedforsecurity=False).hexdigest()


def _key(scene: bpy.types.Scene, data: bpy.types.Camera, reconstruction: Reconstruction) -> None:
    """Key the parameters that change over the scene's frames, and set the others."""
    now, subframe = scene.frame_current, scene.frame_subframe
    frames = range(scene.frame_start, scene.frame_end + 1)
    try:
        rows = []
        for frame in frames:
            scene.frame_set(frame)
            rows.append(_parameters(scene, reconstruction))
    finally:
        scene.frame_set(now, subframe=subframe)
    values = np.array(rows)
    for name, column in zip(KEYED, values.T, strict=True):
        data.cycles_custom[name] = float(column[0])
        if np.ptp(column) <= STEADY * np.abs(column).max():
            continue
        for frame, value in zip(frames, column, strict=True):
            data.cycles_custom[name] = float(value)
            data.keyframe_insert(f'cycles_custom["{name}"]', frame=frame)


def _parameters(scene: bpy.types.Scene, reconstruction: Reconstruction) -> Floats:
    """Values of `KEYED` at the present frame."""
    settings = scene.virtual_aperture
    first, last = (int(reconstruction.frames[n]) for n in (0, -1))
    frame = min(max(clip_frame(scene), first), last)
    options = frame_options(settings, reconstruction)
    pinhole = reconstruction.canvas(frame).pinhole
    lens = options.focus.lens(reconstruction, frame, pinhole, options.radius)
    scale = settings.camera.matrix_world.median_scale
    tilt = np.array(lens.slope) * pinhole.focal / lens.axis
    data = settings.camera.data
    focal = data.lens / data.sensor_width
    return np.array([scale * lens.radius, scale / lens.axis, *tilt, focal, data.shift_x, data.shift_y])
