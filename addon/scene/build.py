"""Bring a solved clip into a Blender scene: one collection, one root, everything under it."""

import itertools
import math
import os
import uuid
from fractions import Fraction
from pathlib import Path

import bpy

from ..core.base.atomic import place_of_temporary
from ..core.base.errors import UserError
from ..core.camera.reconstruction import Reconstruction, typical_distance
from ..core.media.clip import Footage
from ..core.media.clip_identity import identity
from ..core.media.constant_rate import FASTEST
from ..core.media.sequence import blender_shift
from ..core.media.video_frame import BlenderView
from ..core.sfm.workspace import default_work_dir
from . import parts
from .base.paths import relative
from .base.preferences import preferred_segmenter
from .base.timeline import check_frames
from .edited_camera import OFFSET
from .focus import focus_marks
from .lens import aperture_cloud, blender_focus, depth_of_field, lens
from .properties import VirtualApertureSettings
from .solve import camera, point_cloud
from .sources import hdr_view
from .sources.colour_space import image_space
from .sources.shot import IDENTITY, forget, reconstruction_of
from .sources.sound import clip_sounds, move_sound, set_sound

LEAST_SIDE = 4
"""Least pixels of a side in Blender."""
NAME = "Virtual Aperture"
NTSC = 1.001
NTSC_ROUNDING = 2e-6
"""Relative difference up to which a rate is one of NTSC's: 24 / 1.001 is written as 23.976, too."""


def build(
    scene: bpy.types.Scene, footage: Footage, reconstruction: Reconstruction
) -> VirtualApertureSettings:
    """Put a solved clip into the scene, replacing the one that was there, and set the scene up for it.

    Frame range, rate, resolution and pixel aspect follow the clip, the view transform becomes Standard (any
    other would change the clip's colours), with a curve for an HDR clip, and the engine becomes ours. Output
    into Blender's default temporary folder, or into the one that was set here for another clip, goes to one
    of the clip's own beside the .blend or the clip instead. A stored blur or f-stop stays, and so do objects
    of the user, the compositor and all other output settings.
    """
    settings: VirtualApertureSettings = scene.virtual_aperture
    stop = settings.f_stop if settings.by_f_stop else 0.0
    forget()
    if min(footage.width, footage.height) < LEAST_SIDE:
        raise UserError(
            f"{footage.path.name} is {footage.width}x{footage.height} pixels; Blender cannot render images"
            f" smaller than {LEAST_SIDE} pixels on a side"
        )
    check_frames(footage)
    parts.leave_shared(scene)
    _set_up_scene(scene, footage, reconstruction)
    _set_up_objects(scene, reconstruction)
    _set_up_camera(settings.camera, reconstruction)
    blender_focus.follow(settings)
    _set_background(settings, footage)
    scene.camera = settings.camera
    for attribute in [a.name for a in settings.points.data.attributes if not a.is_required]:
        settings.points.data.attributes.remove(settings.points.data.attributes[attribute])
    point_cloud.fill(settings.points.data, reconstruction)
    point_cloud.make_hidden(settings.points)
    if _background_problem(settings, footage):
        point_cloud.show(settings.points, True)
    point_cloud.write(settings.points.data, reconstruction)
    settings.points.data[IDENTITY] = uuid.uuid4().hex
    settings.footage = relative(footage.path)
    is_other = settings.clip_identity not in ("", identity(footage.path))
    settings.clip_identity, settings.clip_name = identity(footage.path), footage.path.name
    settings.clip_first, settings.clip_last = footage.frames[0], footage.frames[-1]
    settings.clip_pixel_aspect = footage.pixel_aspect
    settings.clip_step = math.gcd(*(frame - footage.frames[0] for frame in footage.frames)) or 1
    problem = "" if footage.is_stills else _background_problem(settings, footage)
    seen = [f"the camera has no background image, because {problem}"] if problem else []
    settings.clip_notes = "\n".join([*footage.notes, *seen])
    settings.segmenter = settings.segmenter or preferred_segmenter()
    depth_of_field.forget_scale(settings)
    focus_marks.clear(settings)
    if is_other:
        settings.subjects.items.clear()
    lens.reset(settings)
    depth_of_field.set_f_stop(settings, stop)
    aperture_cloud.update(settings)
    _set_output(scene, footage, is_other)
    set_sound(scene, footage)
    scene.frame_set(scene.frame_start)
    return settings


def restore(scene: bpy.types.Scene, footage: Footage | None) -> None:
    """Bring objects of the scene's solve back that were deleted; those that are there stay as they are.

    `footage` is shown behind a new camera, where it could be opened. UserError where the point cloud's mesh,
    which keeps the reconstruction, is gone.
    """
    settings: VirtualApertureSettings = scene.virtual_aperture
    reconstruction = reconstruction_of(settings)
    has_camera = settings.camera is not None
    _set_up_objects(scene, reconstruction)
    point_cloud.make_hidden(settings.points)
    if not has_camera:
        _set_up_camera(settings.camera, reconstruction)
        blender_focus.follow(settings)
        if footage is not None:
            _set_background(settings, footage)
    scene.camera = scene.camera or settings.camera
    aperture_cloud.update(settings)


def restore_camera(scene: bpy.types.Scene, footage: Footage | None) -> None:
    """Restore the clip's camera as it was solved, and the clip behind it from `footage`."""
    settings: VirtualApertureSettings = scene.virtual_aperture
    reconstruction = reconstruction_of(settings)
    settings.camera.parent = settings.root
    camera.animate(settings.camera, reconstruction)
    camera.set_pixel_aspect(scene.render, reconstruction.cameras[0])
    if footage is not None:
        _set_background(settings, footage)
    scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)


def move_clip(scene: bpy.types.Scene, footage: Footage) -> None:
    """Follow a moved clip: set the path, the background and the sound."""
    settings: VirtualApertureSettings = scene.virtual_aperture
    settings.footage = relative(footage.path)
    for background in settings.camera.data.background_images if settings.camera is not None else ():
        if background.image is not None and background.image.get(IDENTITY):
            background.image.filepath = relative(first_file(footage))
    for strip in clip_sounds(scene):
        move_sound(strip, footage)


def _set_up_scene(scene: bpy.types.Scene, footage: Footage, reconstruction: Reconstruction) -> None:
    scene.frame_start, scene.frame_end = footage.frames[0], footage.frames[-1]
    render = scene.render
    render.fps, render.fps_base = blender_rate(footage.fps)
    render.resolution_x, render.resolution_y = footage.width, footage.height
    render.resolution_percentage = 100
    camera.set_pixel_aspect(render, reconstruction.cameras[0])
    render.engine = "VIRTUAL_APERTURE"
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    hdr_view.set_view(scene, scene.virtual_aperture.colour_space or footage.colour_space)


def blender_rate(fps: float) -> tuple[int, float]:
    """Return the rate as Blender's integer and base, whose quotient it is: 30 / 1.001 for 30000/1001, 25 / 2.

    Blender's encoder cuts digits off other bases: it writes 12.63 frames a second for 12 / 0.96.
    """
    whole = round(fps * NTSC)
    if round(fps) != fps and abs(fps * NTSC - whole) < NTSC_ROUNDING * fps:
        return whole, NTSC
    if fps < 1:
        slow = Fraction(1 / fps).limit_denominator(1001)
        return slow.denominator, float(slow.numerator)
    rate = Fraction(fps).limit_denominator(max(1, int(FASTEST / fps)))
    return rate.numerator, float(rate.denominator)


def _set_up_objects(scene: bpy.types.Scene, reconstruction: Reconstruction) -> None:
    """Root, camera, points and virtual cameras: those that exist, and new ones for the others."""
    settings, collection = scene.virtual_aperture, _collection(scene)
    root = settings.root = _object(scene, settings.root, NAME, None, collection, None)
    root.empty_display_size = 0.05 * typical_distance(reconstruction)
    settings.camera = _object(scene, settings.camera, f"{NAME} Camera", bpy.data.cameras, collection, root)
    settings.points = _object(scene, settings.points, f"{NAME} Points", bpy.data.meshes, collection, root)
    settings.aperture = _object(
        scene, settings.aperture, f"{NAME} Virtual Cameras", bpy.data.meshes, collection, settings.camera
    )
    settings.points.hide_render = settings.aperture.hide_render = True


def _set_up_camera(thing: bpy.types.Object, reconstruction: Reconstruction) -> None:
    # The scene has the reconstruction's own unit, whatever that is.
    size = typical_distance(reconstruction)
    camera.animate(thing, reconstruction)
    thing.data.clip_start, thing.data.clip_end = 0.01 * size, 1000 * size
    thing.data.display_size = 0.05 * size


def _collection(scene: bpy.types.Scene) -> bpy.types.Collection:
    for child in scene.collection.children:
        if child.get(IDENTITY):
            return child
    collection = bpy.data.collections.new(NAME)
    collection[IDENTITY] = True
    scene.collection.children.link(collection)
    return collection


def _object(
    scene: bpy.types.Scene,
    existing: bpy.types.Object | None,
    name: str,
    kind: bpy.types.bpy_prop_collection | None,
    collection: bpy.types.Collection,
    parent: bpy.types.Object | None,
) -> bpy.types.Object:
    """The existing object, or a new one; objects outside of the scene go into our collection."""
    thing = existing or bpy.data.objects.new(name, kind.new(name) if kind is not None else None)
    if not parts.is_in(scene, thing):
        collection.objects.link(thing)
    thing.parent = parent
    return thing


def _set_background(settings: VirtualApertureSettings, footage: Footage) -> None:
    """The clip behind the camera, stretched to the frame: stored pixels need not be square."""
    data = settings.camera.data
    for old in [b for b in data.background_images if b.image is None or b.image.get(IDENTITY)]:
        if old.image is not None:
            bpy.data.images.remove(old.image)
        data.background_images.remove(old)
    if _background_problem(settings, footage):
        return
    shift = 0 if footage.is_video else blender_shift(footage.files, footage.frames) or 0
    image = bpy.data.images.load(str(first_file(footage)), check_existing=False)
    # Blender makes all paths relative when a .blend is saved for the first time, and no others later.
    image.filepath = relative(first_file(footage))
    image[IDENTITY] = True
    image.source = "MOVIE" if footage.is_video else "SEQUENCE"
    if name := image_space(settings, footage):
        image.colorspace_settings.name = name
    background = data.background_images.new()
    background.image = image
    background.alpha = 1.0
    background.frame_method = "STRETCH"
    view = footage.video.view if footage.video is not None else BlenderView.SAME
    background.use_flip_x = view == BlenderView.FLIP_X
    background.use_flip_y = view == BlenderView.FLIP_Y
    user = background.image_user
    user.frame_start = footage.frames[0]
    user.frame_offset = footage.frames[0] - 1 + shift
    image[OFFSET] = user.frame_offset
    user.frame_duration = footage.frames[-1] - footage.frames[0] + 1
    user.use_auto_refresh = True
    data.show_background_images = True


def _background_problem(settings: VirtualApertureSettings, footage: Footage) -> str:
    """Why Blender cannot show the clip's pictures behind the camera; empty where it can."""
    if footage.is_stills:
        return "Blender shows sequences of one size only"
    if not footage.fills_display_window:
        return "Blender shows an EXR's data window only"
    if footage.tags.orientation != 1:
        return "Blender does not turn the pictures as their files say"
    if footage.tags.is_narrow or (footage.files and not image_space(settings, footage)):
        return "Blender has no color space like the one that the files are tagged with"
    if footage.video is None:
        is_shown = blender_shift(footage.files, footage.frames) is not None
        return "" if is_shown else "Blender takes the last number of a file name for the frame"
    return {
        BlenderView.CROPPED: "Blender does not crop the clip as its file says",
        BlenderView.TRACK: "Blender shows another video track of the file",
    }.get(footage.video.view, "")


def first_file(footage: Footage) -> Path:
    """Return the video itself, or the first picture of a sequence."""
    return footage.path if footage.is_video else footage.file(footage.frames[0])


def _set_output(scene: bpy.types.Scene, footage: Footage, is_other: bool) -> None:
    """Set an output path unless the user did, or the one set is that of an earlier clip (`is_other`)."""
    render = scene.render
    is_ours = bool(render.filepath) and render.filepath == scene.virtual_aperture.output
    is_temporary = render.filepath.rstrip("/\\") in {"", "/tmp", _temporary_folder()}
    if not is_temporary and not (is_ours and is_other):
        return
    saved = bpy.data.filepath
    folder = default_work_dir(footage.path, Path(saved).parent if saved else footage.path.parent)
    folder = folder.with_name(f"{folder.stem.rstrip(' _-.')}_render")
    if is_other:
        folder = _without_files(folder)
    path = relative(folder)
    # A path that ends in a separator is a folder, in which files are named by their frames.
    render.filepath = path + ("/" if path.startswith("//") else os.sep)
    scene.virtual_aperture.output = render.filepath


def _temporary_folder() -> str:
    """Blender's default output folder, without a last separator; empty if no temporary folder is writable."""
    try:
        return str(place_of_temporary())
    except UserError:
        return ""


def _without_files(folder: Path) -> Path:
    """The folder, or if it has files, the first of FOLDER_2, FOLDER_3 and so on without any."""
    numbered = (folder.with_name(f"{folder.name}_{n}") for n in itertools.count(2))
    return next(f for f in itertools.chain([folder], numbered) if not f.is_dir() or not any(f.iterdir()))
