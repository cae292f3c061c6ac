"""The content of a viewport in Rendered shading: the camera's view through the lens (`preview` makes it).

Blender draws its overlays over an engine's picture, the camera's background image among them, whatever alpha
or depth the engine left: `view_draw` alone would be visible without overlays only. They are drawn into a
separate texture, which Blender lays over the engine's once that has the scene's colours. The camera's frame
in that texture is therefore removed again, and the picture below is visible, in the colours of a render.
"""

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakValueDictionary

import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Matrix

from ...core.base.arrays import Floats
from ...core.base.errors import UserError
from ...scene.base import redraw
from ...scene.base.events import at, watch
from ...scene.base.remedy_words import WORDS
from ...scene.base.timeline import clip_frame
from ...scene.lens.lens import frame_options
from ...scene.sources.clip import WHILE_PLAYED
from ...scene.sources.colour_space import DrawingError
from ...scene.sources.shot import picture_size, shot_of
from ..cg import cg_preview
from ..processes.clip_process import CLIP
from ..views.frame_size import render_size, shape_problem
from ..views.gpu_views import upload
from .overlay import Rectangle, draw_label, draw_message, draw_texture, fill
from .pictures import FAIR, FINE, Half, Picture, Wanted
from .preview import Preview

LOOK = 0.01
"""Seconds between two looks for a better picture, while one is being made."""
TELL = 0.25
"""Seconds between two redraws that only show the progress of the search for depth."""
ROOM = 0.9
"""Size of a picture, as a share of the camera frame's width in pixels in the viewport: a slightly enlarged
one looks as sharp, and costs less. Chosen by inspection."""
PREVIEW = Preview()
"""The one of this Blender: it takes all processors, so there are not two."""


@dataclass
class Shown:
    """The viewport of one engine; textures belong to the thread and the window that draw."""

    picture: Picture | None = None
    texture: Any = None
    """Texture of the picture."""
    clip: Any = None
    """and of the frame as it was shot, which is seen up to the share `wipe` of the width."""
    wipe: float = 0.0
    frame: Rectangle | None = None
    """Left, bottom, width and height of the clip's picture in pixels of the region; None if not seen."""
    said: str = ""
    """The message over it,"""
    level: str = ""
    """Quality of the picture, in small letters."""


_in_regions: WeakValueDictionary[int, Shown] = WeakValueDictionary()
"""By region, as long as Blender keeps the engine that draws it."""
CLIP.stays = lambda: bool(_in_regions)


def update(shown: Shown, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
    """Something of the scene has changed: begin with its picture before the window is drawn again."""
    if shown.frame is not None and not bpy.app.is_job_running("RENDER"):
        with contextlib.suppress(UserError):  # `draw`, which follows, reports the error
            PREVIEW.want(_wanted(context, depsgraph, shown.frame[2]))
            watch(_tick, 0)


def draw(
    engine: bpy.types.RenderEngine, shown: Shown, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph
) -> None:
    """Draw the best picture there is of the frame into a viewport, and have a better one made."""
    scene = depsgraph.scene_eval
    shown.frame, shown.level = camera_frame(context, scene), ""
    _in_regions[context.region.as_pointer()] = shown
    if shown.frame is None:
        shown.said = "Look through the solved camera (Numpad 0) to see the frame through the lens"
        return
    try:
        wanted = _wanted(context, depsgraph, shown.frame[2])
    except UserError as error:
        if isinstance(error, DrawingError):
            watch(_open, 0)
        said = error.worded(WORDS)
        shown.picture, shown.said = None, said[:1].upper() + said[1:]
        return
    if not bpy.app.is_job_running("RENDER"):
        PREVIEW.want(wanted)
        watch(_tick, 0)
    picture = _picture(wanted, shown.picture)
    shape = shape_problem(render_size(scene.render), wanted.shot.size(wanted.frame))
    shown.said = PREVIEW.problem(wanted) or PREVIEW.note or shape[:1].upper() + shape[1:]
    shown.level = _level(wanted, picture)
    if picture is None:
        return
    if picture is not shown.picture:
        shown.picture = picture
        shown.texture, shown.clip = _texture(picture.linear), _texture(picture.clip)
    shown.wipe = depsgraph.scene.virtual_aperture.viewport_wipe if wanted.with_clip else 0.0
    engine.bind_display_space_shader(depsgraph.scene)
    _draw_picture(shown)
    engine.unbind_display_space_shader()


def _picture(wanted: Wanted, shown: Picture | None) -> Picture | None:
    """The best picture there is; a rough one does not replace a good one of the same frame and lens."""
    found = PREVIEW.best(wanted)
    is_rough = found is None or found.level < FAIR
    if is_rough and shown is not None and shown.level >= FAIR and shown.wanted.looks_alike(wanted):
        return shown
    return found or PREVIEW.latest(wanted) or shown


def _texture(picture: Half | None) -> Any:
    """Texture of a picture (h, w, 4), its last row at the bottom."""
    if picture is None:
        return None
    texture = upload(np.flipud(picture).astype(np.float32))
    texture.filter_mode(True)
    return texture


def _draw_picture(shown: Shown) -> None:
    """Linear light into the camera's frame, the clip left of the wipe."""
    assert shown.frame is not None
    # An older picture may have no clip beside it.
    wipe = shown.wipe if shown.clip is not None else 0.0
    parts = [(shown.clip, 0.0, wipe)] if wipe else []
    left, bottom, width, height = shown.frame
    for texture, begin, end in (*parts, (shown.texture, wipe, 1.0)):
        where = left + begin * width, bottom, left + end * width, bottom + height
        draw_texture(texture, where, "ALPHA_PREMULT", (begin, 0.0, end, 1.0))


def _shown_here(context: bpy.types.Context) -> Shown | None:
    """Our engine's content of the viewport that is being drawn."""
    is_engine = context.scene.render.engine == "VIRTUAL_APERTURE"
    if not is_engine or context.space_data.shading.type != "RENDERED":
        return None
    return _in_regions.get(context.region.as_pointer())


def clear_overlays() -> None:
    """Clear Blender's overlays in the rendered frame, among them the clip, stretched to the frame's shape."""
    context = bpy.context
    shown, space = _shown_here(context), context.space_data
    if shown is None or shown.frame is None or shown.picture is None or not space.overlay.show_overlays:
        return
    points = context.scene.virtual_aperture.points
    if points is not None and points.mode == "EDIT":
        # Its vertices are overlays, too.
        return
    left, bottom, width, height = (
        output_in_region(context.region, context.region_data, context.scene) or shown.frame
    )
    with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        gpu.matrix.load_matrix(Matrix.Identity(4))
        # From the region's pixels, (0, 0) bottom left.
        across, up = 2 / context.region.width, 2 / context.region.height
        to_view = (across, 0, 0, -1), (0, up, 0, -1), (0, 0, 1, 0), (0, 0, 0, 1)
        gpu.matrix.load_projection_matrix(Matrix(to_view))
        gpu.state.depth_test_set("NONE")
        fill((left, bottom, left + width, bottom + height), (0.0, 0.0, 0.0, 0.0), "NONE")


def draw_words() -> None:
    """Draw messages over a viewport's picture."""
    context = bpy.context
    shown = _shown_here(context)
    if shown is None:
        return
    scale = context.preferences.system.ui_scale
    if shown.said:
        draw_message(shown.said, context.area, context.region, scale)
    if shown.level and shown.frame is not None:
        draw_label(shown.level, shown.frame, context.area, context.region, scale)


def camera_frame(context: bpy.types.Context, scene: bpy.types.Scene) -> Rectangle | None:
    """Return `frame_in_region` in a viewport's region; None outside of the solved camera's view."""
    space, view, camera = context.space_data, context.region_data, scene.virtual_aperture.camera
    seen = space.camera if space.use_local_camera else scene.camera
    if view.view_perspective != "CAMERA" or camera is None or seen is None or seen.name != camera.name:
        return None
    return frame_in_region(context.region, view, scene)


def boxes_shown(context: bpy.types.Context) -> Sequence[Floats]:
    """Return the boxes of the current frame's subjects and faces, if a viewport shows them; see `Picture`."""
    shown = _in_regions.get(context.region.as_pointer())
    if shown is None or shown.picture is None:
        return ()
    wanted = shown.picture.wanted
    is_here = wanted.frame == wanted.shot.frame_at(clip_frame(context.scene))
    return shown.picture.boxes if is_here else ()


def frame_in_region(
    region: bpy.types.Region, view: bpy.types.RegionView3D, scene: bpy.types.Scene
) -> Rectangle | None:
    """Return left, bottom, width and height in pixels of the clip's picture in a region.

    The region looks through the solved camera. The picture may reach past it; None if it has no size there.
    It has the width of the rendered frame; if that has another shape than the clip, the picture is lower or
    higher, about the same centre.
    """
    output = output_in_region(region, view, scene)
    if output is None:
        return None
    size = render_size(scene.render)
    with contextlib.suppress(UserError):
        clip = picture_size(scene)
        if shape_problem(size, clip):
            left, bottom, width, height = output
            fitting = height * (size[0] * clip[1]) / (size[1] * clip[0])
            return left, bottom + (height - fitting) / 2, width, fitting
    return output


def output_in_region(
    region: bpy.types.Region, view: bpy.types.RegionView3D, scene: bpy.types.Scene
) -> Rectangle | None:
    """Return left, bottom, width and height in pixels of the rendered frame in a region; None without a size.

    The region looks through the solved camera. The frame has the shape of the output, not that of the clip.
    """
    camera = scene.virtual_aperture.camera
    # A view through a camera leaves its scale aside.
    to_world = camera.matrix_world.normalized()
    places = [
        location_3d_to_region_2d(region, view, to_world @ corner)
        for corner in camera.data.view_frame(scene=scene)
    ]
    if any(place is None for place in places):
        return None
    x, y = [place.x for place in places], [place.y for place in places]
    width, height = max(x) - min(x), max(y) - min(y)
    return (min(x), min(y), width, height) if width > 0 and height > 0 else None


def _wanted(context: bpy.types.Context, depsgraph: bpy.types.Depsgraph, room: float) -> Wanted:
    """The content of a context's viewport, whose camera frame has a width in pixels; UserError."""
    scene, shows = depsgraph.scene_eval, depsgraph.scene.virtual_aperture
    is_playing = bool(context.screen is not None and context.screen.is_animation_playing)
    shot = shot_of(scene, WHILE_PLAYED if is_playing else 0.0)
    clip = shot.size(shot.frame_at(clip_frame(scene)))
    # One of few sizes, so that a little zooming changes nothing.
    smaller = max(1, int(clip[0] / max(ROOM * room, 1)))
    return Wanted(
        shot,
        shot.frame_at(clip_frame(scene)),
        frame_options(scene.virtual_aperture, shot.reconstruction),
        (-(-clip[0] // smaller), -(-clip[1] // smaller)),
        "" if shows.viewport_shows == "LENS" else shows.viewport_shows.lower(),
        shows.viewport_wipe > 0,
        is_playing,
        None if shows.viewport_shows != "LENS" else cg_preview.wanted(depsgraph.scene, context.view_layer),
    )


def _level(wanted: Wanted, picture: Picture | None) -> str:
    """How good what is shown is, and how far the search for depth is, without which it gets no better."""
    if PREVIEW.problem(wanted):
        return ""
    said = "Rough"
    if picture is not None and picture.wanted.key == wanted.key and picture.level >= FAIR:
        is_final = picture.level >= (FAIR if wanted.shows else FINE)
        said = "Final" if is_final else "Draft"
    elif picture is not None and picture.level >= FAIR and picture.wanted.looks_alike(wanted):
        said = "Updating"
    if not PREVIEW.finds_depth:
        return said
    stage, share = PREVIEW.progress
    return f"{said}, finding depth" + (f" {100 * share:.0f}%" if stage else "")


_shown = [(-1, 0.0)]
"""The version of the picture that viewports were last drawn with, and when, in seconds."""


def _tick() -> float | None:
    """A timer's turn: viewports are drawn again when there is something new; None when all is done."""
    if not bpy.app.is_job_running("RENDER"):
        # Between two frames of an animation nothing is begun.
        PREVIEW.poll()
    now, (version, shown_at) = time.monotonic(), _shown[0]
    if PREVIEW.version != version or (PREVIEW.finds_depth and now - shown_at > TELL):
        _shown[0] = PREVIEW.version, now
        redraw.viewports("RENDERED")
    return LOOK if PREVIEW.is_busy() or PREVIEW.waits else None


def _open() -> None:
    """A timer's turn: open the clips of windows, which cannot be opened while they are drawn."""
    for window in bpy.context.window_manager.windows:
        with contextlib.suppress(UserError):  # `draw`, which follows, reports the error
            shot_of(window.scene)
    redraw.viewports("RENDERED")


def end() -> None:
    """Switch the viewports that show our pictures to Solid shading.

    Without our engine Blender uses EEVEE for them, which shows the surroundings of the camera.
    """
    manager = bpy.context.window_manager
    for window in manager.windows if manager is not None else ():
        if window.scene.render.engine != "VIRTUAL_APERTURE":
            continue
        for area in window.screen.areas:
            for space in area.spaces:
                if space.type == "VIEW_3D" and space.shading.type == "RENDERED":
                    space.shading.type = "SOLID"


@at("load_post")
def _on_loaded(*_: object) -> None:
    warm()


def warm(soon: bool = False) -> None:
    """Start the preview's process if the file has a solved clip, or will have one `soon`; else end it."""
    if soon or any(scene.virtual_aperture.points is not None for scene in bpy.data.scenes):
        if not bpy.app.background:
            with contextlib.suppress(UserError):  # reported with the first call
                CLIP.begin()
    else:
        CLIP.end()


@at("load_pre")
def _forget(*_: object) -> None:
    PREVIEW.forget()
    cg_preview.forget()


def stop() -> None:
    """End what is shown and under way."""
    end()
    _forget()
    CLIP.end()
