"""All panels draw in every state of a scene, and say in it what is to be done."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import pytest

from addon.core.base.messages import Failure
from addon.core.camera.reconstruction import Intrinsics
from addon.core.readers.matching import Imported
from addon.core.sfm.process import SolveProgress
from addon.core.sfm.workspace import keep_import
from addon.scene.build import build
from addon.ui import panels
from addon.ui.base.solving import Solving
from addon.ui.footage.solve import build_scene
from addon.ui.jobs import depth_ahead

from ..foreign_models import write_clip
from ..in_blender import select
from ..recorder import draw
from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
Settings = bpy.types.PropertyGroup
LONGEST = 24
"""Characters of a line that a sidebar shows whole as Blender opens it."""


def no_clip(settings: Settings, _folder: Path) -> None:
    settings.footage = ""


def chosen(settings: Settings, _folder: Path) -> None:
    settings.clip_identity = ""
    for name in ("root", "camera", "points", "aperture"):
        bpy.data.objects.remove(getattr(settings, name))


def solving(settings: Settings, folder: Path) -> None:
    chosen(settings, folder)
    running = Solving.running = Solving(lambda: None)  # type: ignore[arg-type]
    running.step = SolveProgress("Registered 3 of 12 frames", 0.25, 40.0)


def solved(_settings: Settings, _folder: Path) -> None:
    return


def in_edit_mode(settings: Settings, _folder: Path) -> None:
    select(settings.points, (1, 2, 3))


def focused(settings: Settings, folder: Path) -> None:
    in_edit_mode(settings, folder)
    bpy.ops.virtual_aperture.set_focus()


def marked(settings: Settings, _folder: Path) -> None:
    bpy.ops.virtual_aperture.pick_subject(places="0.5,0.5 0.5,0.6")
    settings.subjects.items[0].unsure = "2"


def of_another_shape(settings: Settings, _folder: Path) -> None:
    bpy.context.scene.render.resolution_y = 160


def moved(settings: Settings, folder: Path) -> None:
    (folder / "clip").rename(folder / "clip2")


def wrong(settings: Settings, folder: Path) -> None:
    settings.footage = str(write_clip(folder / "other"))


def finding(settings: Settings, folder: Path) -> None:
    ahead = depth_ahead._ahead = depth_ahead.DepthAhead(folder / "work")
    ahead.is_running, ahead.done, ahead.total = True, 1, 3


def paused(settings: Settings, folder: Path) -> None:
    finding(settings, folder)
    depth_ahead._ahead = None


def failed(_settings: Settings, folder: Path) -> None:
    depth_ahead._ahead = depth_ahead.DepthAhead(folder / "work")
    depth_ahead._ahead.failure = Failure("no space is left")


def unsure(settings: Settings, folder: Path) -> None:
    finding(settings, folder)
    assert depth_ahead._ahead is not None
    depth_ahead._ahead.is_running = False
    depth_ahead._ahead.warnings.append("moving subjects are uncertain in 3 frames")


def without(name: str) -> Callable[[Settings, Path], None]:
    def state(settings: Settings, _folder: Path) -> None:
        bpy.data.objects.remove(getattr(settings, name))

    return state


def newer(settings: Settings, _folder: Path) -> None:
    settings.version = 99


def solving_the_wrong_one(settings: Settings, folder: Path) -> None:
    wrong(settings, folder)
    Solving.running = Solving(lambda: None)  # type: ignore[arg-type]


STATES: list[tuple[str, Callable[[Settings, Path], None], str]] = [
    ("no clip", no_clip, "or choose a clip or a folder"),
    ("clip chosen", chosen, "Solve the clip to find its camera motion"),
    ("solving", solving, "Registered 3 of 12 frames About 40 s left, ESC cancels"),
    ("solved", solved, "Automatic focus"),
    ("in focus", focused, "In focus: Point cloud"),
    ("with a subject", marked, "Uncertain in 1 frame"),
    ("another output shape", of_another_shape, "size 160x160 has another shape than the clip's 160x90"),
    ("clip moved", moved, "locate it with Find Clip"),
    ("wrong clip", wrong, "the chosen clip is other"),
    ("solving the other clip", solving_the_wrong_one, "Reading the clip ESC cancels"),
    ("depth under way", finding, "Depth: 1 of 3 frames"),
    ("depth failed", failed, "Depth was not found: no space is left"),
    ("a subject unsure", unsure, "Moving subjects are uncertain in 3 frames"),
    ("camera deleted", without("camera"), "The clip's camera was deleted"),
    ("root deleted", without("root"), "The objects of this solve were deleted"),
    ("newer", newer, "made with a newer Virtual Aperture"),
]
"""Name, what brings an imported clip's scene into the state, and words that the panels show in it."""


@pytest.mark.parametrize("make, said", [state[1:] for state in STATES], ids=[state[0] for state in STATES])
def test_panels_draw(
    scene: bpy.types.Scene, tmp_path: Path, make: Callable[[Settings, Path], None], said: str
) -> None:
    shot, work = slanted_shot(tmp_path / "clip", LENS), tmp_path / "work"
    keep_import(Imported(shot.reconstruction, "true cameras", ()), shot.footage, work)
    settings = scene.virtual_aperture
    settings.footage, settings.work_dir = str(shot.footage.path), str(work)
    build_scene(scene, shot.footage, work)
    try:
        make(settings, tmp_path)
        shown = [draw(panel) for panel in panels.CLASSES]
    finally:
        Solving.running = None
        depth_ahead._ahead = None
    texts = " ".join(text for each in shown for text in each.texts)
    # Wrapped texts are in lines.
    assert said in texts
    # Nobody is told to solve what is being solved.
    assert make is not solving_the_wrong_one or "the chosen clip is" not in texts
    # Of a solve that cannot be used nothing is said.
    unsolved = (no_clip, chosen, solving, solving_the_wrong_one, newer)
    assert ("Solved" in texts) == (make not in unsolved and settings.points is not None)
    for name in {name for each in shown for name in each.operators}:
        group, operator = name.split(".")
        # It answers whether it may be pressed; why not is a message, without which a button is a riddle.
        getattr(getattr(bpy.ops, group), operator).poll()


WARNED = (of_another_shape, wrong, failed, without("camera"))


@pytest.mark.parametrize("make", WARNED, ids=lambda make: make.__name__)
def test_a_warning_is_a_line_below_the_buttons(
    scene: bpy.types.Scene, tmp_path: Path, make: Callable[[Settings, Path], None]
) -> None:
    shot, work = slanted_shot(tmp_path / "clip", LENS), tmp_path / "work"
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.work_dir = str(work)
    before = draw(panels.main.VIRTUAL_APERTURE_PT_main)
    assert "Details" not in before.texts
    try:
        make(settings, tmp_path)
        after = draw(panels.main.VIRTUAL_APERTURE_PT_main)
        details = draw(panels.notices.VIRTUAL_APERTURE_PT_details)
    finally:
        depth_ahead._ahead = None
    assert after.operators == before.operators
    at = after.texts.index("Details")
    # The name of the clip and of the movie may be another one's.
    assert at == len(before.texts)
    (line,) = after.texts[at + 1 :]
    assert len(line) <= LONGEST and len(" ".join(details.texts)) > len(line)


def test_advice_alone_stands_in_its_place(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS)
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.advice = "depth is not exact: keep the blur small, or film with more sideways movement"
    texts = draw(panels.main.VIRTUAL_APERTURE_PT_main).texts
    assert "Details" not in texts and settings.advice.capitalize() in " ".join(texts)


def test_the_clip_size_is_the_way_out_of_another_shape(scene: bpy.types.Scene, tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Solve the clip first"):
        bpy.ops.virtual_aperture.use_clip_size()
    shot = slanted_shot(tmp_path / "clip", LENS)
    build(scene, shot.footage, shot.reconstruction)
    use = "virtual_aperture.use_clip_size"
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 1000, 1000, 50
    assert use in draw(panels.notices.VIRTUAL_APERTURE_PT_details).operators
    assert bpy.ops.virtual_aperture.use_clip_size() == {"FINISHED"}
    assert (render.resolution_x, render.resolution_y, render.resolution_percentage) == (160, 90, 50)
    assert use not in draw(panels.main.VIRTUAL_APERTURE_PT_main).operators
