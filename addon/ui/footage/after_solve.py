"""Views in the windows after a solve has come into the scene."""

import math
from collections.abc import Sequence

import bpy
import numpy as np

from ...core.base.arrays import Floats
from ...core.camera.reconstruction import Reconstruction
from ...render.viewport.overlay import Rectangle, free_part
from ...render.viewport.viewport import frame_in_region

MARGIN = 0.98
"""Share of a viewport's free width or height for a camera's frame."""
LEAST_ZOOM, MOST_ZOOM = -30.0, 600.0
"""Bounds of the zoom of a camera view, in Blender's unit."""
PROBE = 0.1
"""Offset of a camera view, in Blender's measure, by which is found how far one moves the frame."""
SOLID = {"MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME"}
"""Types of objects that hide what is behind them."""


def show(scene: bpy.types.Scene, reconstruction: Reconstruction) -> None:
    """Look through the camera, make the point cloud the active object, clear the camera's way."""
    settings = scene.virtual_aperture
    manager = bpy.context.window_manager
    windows = [window for window in manager.windows if window.scene == scene] if manager else []
    for window in windows:
        look_through_camera(window)
    # Clicks in Edit Mode are to find vertices: there is nothing else in the point cloud.
    scene.tool_settings.mesh_select_mode = (True, False, False)
    for layer in {window.view_layer for window in windows} or {scene.view_layers[0]}:
        make_active(settings.points, layer)
    clear_the_way(scene, reconstruction)


def look_through_camera(window: bpy.types.Window) -> None:
    """Show the scene's camera view, with all of its frame, in every 3D viewport of a window."""
    for area in window.screen.areas:
        if area.type != "VIEW_3D" or area.spaces.active.region_3d is None:
            continue
        area.spaces.active.region_3d.view_perspective = "CAMERA"
        if not bpy.app.background:
            _fit(window, area)


def _fit(window: bpy.types.Window, area: bpy.types.Area) -> None:
    """Put the camera's frame in the middle of a viewport's free part, as large as possible."""
    view = area.spaces.active.region_3d
    region = next(each for each in area.regions if each.type == "WINDOW" and each.data == view)

    def shown(zoom: float, offset: Sequence[float]) -> Rectangle | None:
        view.view_camera_zoom, view.view_camera_offset = zoom, offset
        with bpy.context.temp_override(window=window, area=area, region=region):
            view.update()
        return frame_in_region(region, view, window.scene)

    before = shown(0.0, (0.0, 0.0))
    left, bottom, right, top = free_part(area, region)
    if before is None or right <= left or top <= bottom:
        return
    share = MARGIN * min((right - left) / before[2], (top - bottom) / before[3])
    # A frame's size goes with ((sqrt 2 + zoom / 50) / 2) squared.
    zoom = float(np.clip(50 * math.sqrt(2) * (math.sqrt(share) - 1), LEAST_ZOOM, MOST_ZOOM))
    still, moved = shown(zoom, (0.0, 0.0)), shown(zoom, (PROBE, PROBE))
    if still is not None and moved is not None:
        wished = (left + right - still[2]) / 2 - still[0], (bottom + top - still[3]) / 2 - still[1]
        shown(zoom, [PROBE * wished[axis] / (moved[axis] - still[axis]) for axis in (0, 1)])


def make_active(points: bpy.types.Object, layer: bpy.types.ViewLayer) -> None:
    """Deselect all and make the point cloud active, so that Tab edits it, unless something is edited."""
    active = layer.objects.active
    if points.name not in layer.objects or (active is not None and active.mode != "OBJECT"):
        return
    for thing in layer.objects:
        # Not the point cloud either: a selected one is drawn all orange, and Tab asks for the active one.
        thing.select_set(False, view_layer=layer)
    layer.objects.active = points


def clear_the_way(scene: bpy.types.Scene, reconstruction: Reconstruction) -> None:
    """Hide the user's objects that the camera goes through, and list them in the settings.

    They are hidden with the eye, in every view layer. Objects of an earlier solve's list stay on it while
    they are hidden, and so do objects that the user had hidden before.
    """
    settings = scene.virtual_aperture
    ours = {settings.root, settings.camera, settings.points, settings.aperture}
    to_world = np.array(settings.root.matrix_world)
    centres = np.array([image.centre for image in reconstruction.images])
    centres = centres @ to_world[:3, :3].T + to_world[:3, 3]
    blocking = still_hidden(scene)
    for thing in scene.objects:
        is_candidate = thing not in ours and thing.type in SOLID and thing not in blocking
        if is_candidate and _is_placed(thing) and holds(thing, centres):
            blocking.append(thing)
            for layer in layers_of(scene, thing):
                thing.hide_set(True, view_layer=layer)
    settings.hidden.clear()
    for thing in blocking:
        settings.hidden.add().thing = thing


def _is_placed(thing: bpy.types.Object) -> bool:
    """Return whether Blender evaluates an object: those disabled in viewports are not evaluated."""
    return not thing.hide_viewport and any(not each.hide_viewport for each in thing.users_collection)


def holds(thing: bpy.types.Object, places: Floats) -> bool:
    """Return whether any of the places (n, 3) in the world lies in the object's bounding box."""
    try:
        to_local = np.array(thing.matrix_world.inverted())
    except ValueError:
        return False
    local = places @ to_local[:3, :3].T + to_local[:3, 3]
    corners = np.array([corner[:] for corner in thing.bound_box])
    return bool(np.any(np.all((local >= corners.min(axis=0)) & (local <= corners.max(axis=0)), axis=1)))


def still_hidden(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the objects that were hidden for the camera and still are, in any view layer."""
    things = [entry.thing for entry in scene.virtual_aperture.hidden]
    return [
        thing for thing in things if any(thing.hide_get(view_layer=each) for each in layers_of(scene, thing))
    ]


def layers_of(scene: bpy.types.Scene, thing: bpy.types.Object | None) -> list[bpy.types.ViewLayer]:
    """Return the view layers of a scene that hold an object."""
    return [layer for layer in scene.view_layers if thing in layer.objects.values()]


def hidden_words(things: Sequence[bpy.types.Object]) -> str:
    """Describe in one line which objects were hidden."""
    names = [thing.name for thing in things]
    if len(names) == 1:
        return f"{names[0]} blocked the camera and was hidden; Alt H shows it"
    return f"{', '.join(names)} blocked the camera and were hidden; Alt H shows them"
