"""The pictures of the documentation, taken while a user does what its pages say: in order, in one Blender.

They go to `build/window/pictures/docs`; `make pictures` copies them into `docs/pictures`.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from . import file_drop
from .program import EXTENSION, ROOT, Program
from .screen import Screen
from .steps import (
    CLIP,
    DEPTH,
    DOWN,
    LEFT,
    MODAL,
    PICTURES,
    PRESETS,
    SETTINGS,
    UP,
    begin,
    ended,
    first_window,
    open_below,
    open_details,
    opened,
    over,
    running,
    show_preferences,
)  # fmt: skip

MADE = PICTURES / "pictures" / "docs"
WIDEST, HEAVIEST = 900, 60_000
"""Pixels, and bytes of a picture."""
FLAT = 8.0
"""Standard deviation in grey levels that a picture of something has: an empty viewport's is below 2."""
MENU = 0.6
"""Seconds until Blender has drawn a menu or a dialog."""
SCRUBBED = range(1, 37, 3)
"""Frames of the sample clip through which the focus is seen to be pulled."""
BUSY = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW.is_busy()"
SOLVING_DROPPED = f"'VIRTUAL_APERTURE_OT_import_clip' in {MODAL}"
MUG, GLOBE, PLANT = (0.2, 0.85), (0.53, 0.45), (0.9, 0.45)
"""Places of the sample clip, fractions of the picture."""

Box = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels of the screen."""

pytestmark = pytest.mark.usefixtures("in_order")


@pytest.fixture(scope="module")
def program(screen: Screen, resources: Path) -> Iterator[Program]:
    with running(screen, resources, "pictures", tab=False) as made:
        yield made


def keep(program: Program, name: str, *boxes: Box) -> None:
    """Take a picture of parts of the screen, beside each other, for the documentation."""
    seen = program.shot(name)
    parts = [
        seen[round(top) : round(bottom), round(left) : round(right)] for left, top, right, bottom in boxes
    ]
    keep_picture(name, np.hstack(parts))


def keep_picture(name: str, picture: np.ndarray) -> None:
    """Write a picture (H, W, 3) as light as its place in a page allows."""
    assert picture.std() > FLAT, f"{name} shows nothing"
    if picture.shape[1] > WIDEST:
        size = WIDEST, round(picture.shape[0] * WIDEST / picture.shape[1])
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    MADE.mkdir(parents=True, exist_ok=True)
    for quality in range(90, 40, -5):
        _, data = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
        if len(data) <= HEAVIEST:
            break
    (MADE / f"{name}.jpg").write_bytes(data.tobytes())


def sidebar(program: Program) -> Box:
    left, top, width, height = program.rectangle("VIEW_3D", "UI")
    return left, top, left + width, top + height


def clip_frame(program: Program) -> Box:
    """Where the viewport shows the clip."""
    return *over(program, (0.0, 0.0)), *over(program, (1.0, 1.0))


def at_work(program: Program) -> Box:
    """The clip in the viewport, and the sidebar."""
    _, top, right, bottom = sidebar(program)
    return clip_frame(program)[0] - 10, top - 5, right, bottom


def scroll(program: Program, way: int) -> None:
    """To an end of the sidebar."""
    x, y = program.middle("VIEW_3D", "UI")
    for _ in range(30):
        program.screen.click(x, y, way)
    program.settle()


def rest(program: Program) -> None:
    """Move the mouse to where it shows no tip, and wait for the best preview."""
    left, top, _, height = program.rectangle("VIEW_3D")
    program.screen.move(left + 150, top + height - 15)
    program.settle()
    time.sleep(MENU)
    program.wait(f"not {BUSY}", 120)
    time.sleep(MENU)
    program.settle()


def keep_sub_panel(
    program: Program, name: str, panel: str, below: str, inside: str, up: float, down: float
) -> None:
    """A picture of a closed sub-panel, the first one below a button of a panel, so far up and down from a
    button in it."""
    with opened(program, panel):
        open_below(program, below)
        y = program.find(inside, "VIEW_3D", "UI").y
        rest(program)
        left, _, right, _ = sidebar(program)
        keep(program, name, (left, y - up, right, y + down))


def test_drop(program: Program, folder: Path) -> None:
    project = folder / "pictures"
    project.mkdir()
    shutil.copy(CLIP, project)
    program.show_sidebar("Virtual Aperture")
    x, y = program.middle("VIEW_3D")
    place = str(round(x - 150)), str(round(y))
    subprocess.run(
        [sys.executable, file_drop.__file__, *place, str(project / CLIP.name)],
        env=program.screen.environment, check=True,
    )  # fmt: skip
    program.settle()
    time.sleep(MENU)
    keep(program, "drop", (x - 460, y - 230, sidebar(program)[2], y + 150))
    program.screen.key("s")
    program.wait(SOLVING_DROPPED)


def test_solve(program: Program) -> None:
    time.sleep(5)
    program.settle()
    left, top, right, _ = sidebar(program)
    keep(program, "solving", (left, top, right, top + 275))
    program.wait(f"{SETTINGS}.points is not None", 120)
    program.wait(f"{DEPTH} and {DEPTH}.done > 5", 60)
    rest(program)
    keep(program, "solved", at_work(program))
    program.wait(f"not {DEPTH}.is_running", 240)


def test_preview(program: Program) -> None:
    program.press("virtual_aperture.preview()", across=LEFT)
    rest(program)
    scroll(program, UP)
    rest(program)
    keep(program, "preview", at_work(program))


def test_pick_focus(program: Program) -> None:
    begin(program)
    program.screen.move(*over(program, MUG))
    program.settle()
    time.sleep(MENU)
    program.settle()
    left, top, right, bottom = clip_frame(program)
    keep(program, "pick", (left, top, right, bottom))
    program.screen.click(*over(program, MUG))
    ended(program)


def test_pull(program: Program) -> None:
    program.ask("bpy.context.scene.frame_set(30)")
    program.settle()
    begin(program, add=True)
    program.screen.click(*over(program, PLANT))
    ended(program)
    rest(program)
    assert program.ask(f"[mark.frame for mark in {SETTINGS}.marks.items]") == [1, 30]
    with opened(program, "Focus"):
        rest(program)
        left, top, right, _ = sidebar(program)
        keep(program, "marks", (left, top, right, top + 420))
    left = sidebar(program)[0]
    view, top, _, height = program.rectangle("VIEW_3D")
    keep(program, "strip", (view + 50, clip_frame(program)[3] - 150, left - 10, top + height))
    left, top, _, height = program.rectangle("DOPESHEET_EDITOR")
    keep(program, "timeline", (left, top - 32, left + 620, top + height))


def test_the_pull_in_the_viewport(program: Program) -> None:
    for frame in SCRUBBED:
        program.ask(f"bpy.context.scene.frame_set({frame})")
        rest(program)
        program.shot(f"scrub_{frame:02d}")


def test_overlays(program: Program) -> None:
    program.ask("bpy.context.scene.frame_set(1)")
    seen = []
    for shows in ("FOCUS", "BLUR", "DEPTH", "LENS"):
        program.ask(
            f"{SETTINGS}.viewport_shows = {shows!r}; {SETTINGS}.viewport_wipe = {shows == 'LENS'} / 2"
        )
        rest(program)
        left, top, right, bottom = (round(each) for each in clip_frame(program))
        seen.append(program.shot(f"overlay_{shows.lower()}")[top:bottom, left:right])
    program.ask(f"{SETTINGS}.viewport_wipe = 0")
    keep_picture("overlays", np.vstack([np.hstack(seen[:2]), np.hstack(seen[2:])]))


def test_presets(program: Program) -> None:
    y = program.find(".blur_percent", "VIEW_3D", "UI").y
    left, _, right, _ = sidebar(program)
    program.screen.click(left + PRESETS * (right - left), y)
    program.settle()
    time.sleep(MENU)
    keep(program, "presets", (left - 150, y - 60, right + 80, y + 420))
    program.screen.key("Escape")
    rest(program)


def test_scale(program: Program) -> None:
    scroll(program, UP)
    y = program.find("set_scale", "VIEW_3D", "UI").y
    rest(program)
    left, _, right, _ = sidebar(program)
    keep(program, "scale", (left, y - 90, right, y + 40))


def test_masks(program: Program) -> None:
    keep_sub_panel(program, "masks", "Solve", "solve(again=True)", "depth_maps", 105, 25)


def test_aperture_shape(program: Program) -> None:
    with opened(program, "Lens"):
        # Past the button above, whose tooltip is as large as a panel.
        open_below(program, "add_lens_camera")
        open_below(program, "metres_per_unit")
        y = program.find("shape.image", "VIEW_3D", "UI").y
        rest(program)
        left, _, right, _ = sidebar(program)
        keep(program, "shape", (left, y - 350, right, y + 25))


def test_passes(program: Program) -> None:
    keep_sub_panel(program, "passes", "Render", "virtual_aperture.export", "use_pass_z", 46, 100)


def test_preferences(program: Program) -> None:
    show_preferences(program, "ADDONS")
    expand = f'addon_expand(module="{EXTENSION}")'
    button = program.find(expand, "PREFERENCES", "WINDOW", across=0.01, window=1)
    program.screen.click(button.x, button.y)
    time.sleep(MENU)
    left, _, width, _ = program.rectangle("PREFERENCES", "WINDOW", 1)
    program.screen.move(left + width / 2, 950)
    program.settle()
    keep(program, "preferences", (left, button.y + 195, left + width, button.y + 332))
    first_window(program)


def test_the_list_of_the_last_render(program: Program) -> None:
    # Such a blur is more than layers carry: the render says so.
    program.ask(f"{SETTINGS}.blur = 0.9; bpy.context.scene.render.resolution_percentage = 25")
    program.render(seconds=180)
    first_window(program)
    scroll(program, DOWN)
    x, y = open_details(program, "render_clip")
    program.screen.move(x, y + 30)
    program.still()
    keep(program, "report", (x - 260, y - 20, x + 200, y + 160))


def test_the_pages_show_these_pictures() -> None:
    pages = "".join(page.read_text() for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    for picture in MADE.iterdir():
        assert f"pictures/{picture.name}" in pages, picture
