"""Runs inside Blender: answers questions about its state over a socket, between its own events.

    blender --python driver.py -- SOCKET

A question is a line of JSON, a string of Python. The answer is a line of JSON: {"value": V} of its last
expression, or {"error": TRACEBACK}. Only state is read here; what a user does comes from mouse and keys.
"""

from __future__ import annotations

import ast
import json
import random
import select
import socket
import sys
import time
import traceback
from typing import Any

import bmesh  # noqa: F401  questions ask it
import bpy
from bpy.app.handlers import persistent

LOOK = 0.005
"""Seconds between two looks for a question."""

log: list[list[Any]] = []
"""[what, time.time()] of each render's `init`, `complete`, `cancel`, `write` (of a file), and of the render
job's `busy` and `idle`."""
_state: dict[str, Any] = {"busy": False, "connection": None, "unread": b"", "redraws": 0}


def view(kind: str, window: int = 0) -> dict[str, Any]:
    """Context of the largest area of a kind, for `temp_override`; its main region."""
    shown = bpy.context.window_manager.windows[window]
    areas = [area for area in shown.screen.areas if area.type == kind]
    area = max(areas, key=lambda area: area.width * area.height)
    region = next(region for region in area.regions if region.type == "WINDOW")
    return {"window": shown, "area": area, "region": region}


def region_of(kind: str, region: str, window: int = 0) -> dict[str, Any]:
    """Context of a region of the largest area of a kind."""
    found = view(kind, window)
    found["region"] = next(r for r in found["area"].regions if r.type == region)
    return found


def rectangle(kind: str, region: str, window: int = 0) -> list[int]:
    """Left, bottom, width, height of a region on the screen, pixels from the bottom left."""
    found = region_of(kind, region, window)
    shown, where = found["window"], found["region"]
    return [shown.x + where.x, shown.y + where.y, where.width, where.height]


def button_under_mouse(kind: str, region: str, window: int = 0) -> str:
    """What the button under the mouse does: a call of an operator, or the path of a property."""
    for copy in (bpy.ops.ui.copy_python_command_button, bpy.ops.ui.copy_data_path_button):
        with bpy.context.temp_override(**region_of(kind, region, window)):
            if copy.poll():
                copy()
                return bpy.context.window_manager.clipboard
    return ""


def project(points: Any) -> list[list[float]]:
    """Places (x, y) of world positions on the screen, as the first window's 3D viewport shows them, pixels
    from the bottom left; those outside of its main region are left out."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    found = view("VIEW_3D")
    left, bottom, width, height = rectangle("VIEW_3D", "WINDOW")
    space = found["area"].spaces.active.region_3d
    places = [location_3d_to_region_2d(found["region"], space, point) for point in points]
    return [[left + x, bottom + y] for x, y in (p for p in places if p) if 0 < x < width and 0 < y < height]


def messages() -> list[str]:
    """What this session reported, as the Info editor shows it; without the calls of operators in it."""
    window = bpy.context.window_manager.windows[0]
    area = min(window.screen.areas, key=lambda area: area.width * area.height)
    kind = area.ui_type
    area.ui_type = "INFO"
    try:
        region = next(region for region in area.regions if region.type == "WINDOW")
        with bpy.context.temp_override(window=window, area=area, region=region):
            bpy.ops.info.select_all(action="SELECT")
            bpy.ops.info.report_copy()
            bpy.ops.info.select_all(action="DESELECT")
        lines = bpy.context.window_manager.clipboard.splitlines()
        return [line for line in lines if not line.startswith("bpy.")]
    finally:
        area.ui_type = kind


def save_result(file: str) -> str:
    """Write the Render Result in the scene's format; why it could not be, or an empty string."""
    try:
        bpy.data.images["Render Result"].save_render(file)
    except RuntimeError as error:
        return str(error).strip()
    return ""


_chance = random.Random(1)


def redraw() -> float:
    """A timer's turn: draw one of the windows, by chance, as many times as `_state["redraws"]` says.

    Each has a GPU context of its own, and the one drawn last is active: now this window's, now that's, as
    where the mouse moves over one while a render shows its progress in the other.
    """
    if _state["redraws"]:
        _state["redraws"] -= 1
        with bpy.context.temp_override(window=_chance.choice(bpy.context.window_manager.windows)):
            bpy.ops.wm.redraw_timer(type="DRAW_WIN", iterations=1)
    return 0.1


def answer(question: str) -> Any:
    """Run Python in this module's namespace; the value of the last expression."""
    tree = ast.parse(question)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "question", "exec"), globals())
    if last is None:
        return None
    value = eval(compile(ast.Expression(last.value), "question", "eval"), globals())
    # What an operator ended with.
    return sorted(value) if isinstance(value, set) else value


def look() -> float:
    """A timer's turn: note whether a render runs, answer what was asked."""
    busy = bpy.app.is_job_running("RENDER")
    if busy != _state["busy"]:
        _state["busy"] = busy
        log.append(["busy" if busy else "idle", time.time()])
    connection = _state["connection"]
    while select.select([connection], [], [], 0)[0]:
        received = connection.recv(1 << 20)
        if not received:
            # The test is gone.
            sys.exit(0)
        _state["unread"] += received
    *lines, _state["unread"] = _state["unread"].split(b"\n")
    for line in lines:
        try:
            reply = json.dumps({"value": answer(json.loads(line))})
        except Exception:
            reply = json.dumps({"error": traceback.format_exc()})
        connection.sendall(reply.encode() + b"\n")
    return LOOK


def noting(what: str) -> Any:
    """A handler that stays when another file is opened."""

    @persistent
    def note(*_: Any) -> None:
        log.append([what, time.time()])

    return note


def main() -> None:
    handlers = bpy.app.handlers
    for what in ("init", "complete", "cancel", "write"):
        getattr(handlers, f"render_{what}").append(noting(what))
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(sys.argv[sys.argv.index("--") + 1])
    _state["connection"] = connection
    bpy.app.timers.register(look, first_interval=0.5, persistent=True)


if __name__ == "__main__":
    main()
