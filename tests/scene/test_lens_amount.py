"""What the panel shows as a setting of the amount of blur changes by its own setters alone."""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.camera.reconstruction import Intrinsics, Reconstruction
from addon.core.focus.focus import Focus, radius_for_blur
from addon.core.focus.place import Place
from addon.core.media.clip import open_footage
from addon.scene.build import build
from addon.scene.focus import focus_marks
from addon.scene.focus.refocus import keep_focus, restore_focus
from addon.scene.lens.lens import frame_options
from addon.scene.sources.shot import reconstruction_of
from addon.ui import panels
from addon.ui.focus.lens_presets import preset_files
from addon.ui.jobs.first_person import _put as first_found
from addon.ui.picking.pick_vertices import focus_on

from ..recorder import draw
from ..scenes import slanted_plane, write_frames
from ..variants import variants

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
FRAMES = tuple(range(1, 9))
AMOUNT = ("blur_percent", "f_stop", "aperture_radius")


def scaled(solve: Reconstruction, times: float) -> Reconstruction:
    """The same scene in another unit, as another solve of the clip has it."""
    images = tuple(replace(each, translation=each.translation * times) for each in solve.images)
    return replace(solve, images=images, points=replace(solve.points, xyz=solve.points.xyz * times))


def zooming(solve: Reconstruction) -> Reconstruction:
    lenses = tuple(replace(LENS, fx=140.0 + 9 * n, fy=140.0 + 9 * n) for n in range(len(solve.images)))
    return replace(
        solve, cameras=lenses, images=tuple(replace(i, camera=n) for n, i in enumerate(solve.images))
    )


class Hands:
    """A user who does all but set the amount of blur."""

    def __init__(self, clip: Path, r: random.Random) -> None:
        self.clip, self.r = clip, r
        self.other = write_frames(clip.parent / "other", LENS, FRAMES[:2])

    @property
    def scene(self) -> bpy.types.Scene:
        return bpy.context.scene

    @property
    def settings(self) -> bpy.types.PropertyGroup:
        return self.scene.virtual_aperture

    def place(self) -> Place:
        frame, away = self.scene.frame_current, self.r.uniform(5.2, 11.5)
        unit = reconstruction_of(self.settings).typical_depth / 7
        if self.r.random() < 0.5:
            points = tuple(self.r.sample(range(150), 4))
            away = 1 / Focus(points).inverse_depth(reconstruction_of(self.settings), frame)
            return Place(Focus(points), frame, away, "points")
        return Place(Focus(distance=away * unit), frame, away * unit, "a distance")

    def scrub(self) -> None:
        self.scene.frame_set(self.r.choice(FRAMES))

    def pick(self) -> None:
        focus_on(self.settings, self.scene.frame_current, [self.place()])

    def mark(self) -> None:
        focus_marks.put(self.settings, self.scene.frame_current, [self.place()], add=True)

    def first_subject(self) -> None:
        focus_marks.put_first(self.settings, self.place())

    def distance(self) -> None:
        self.settings.focus_distance = self.r.uniform(5, 12)

    def tilt(self) -> None:
        self.settings.focus_tilt = self.r.uniform(-0.3, 0.3)

    def remove(self) -> None:
        if len(self.settings.marks.items) > 1:
            focus_marks.remove(self.settings, self.r.randrange(len(self.settings.marks.items)))

    def thing(self) -> None:
        made = bpy.data.objects.new("Target", None)
        self.scene.collection.objects.link(made)
        made.location = (0, 0, self.r.uniform(5, 9))
        self.settings.camera.data.dof.focus_object = made
        bpy.context.view_layer.update()

    def preset(self) -> None:
        if not self.settings.f_stop or "f_stop" not in shown():
            file = str(self.r.choice(sorted(preset_files())))
            assert bpy.ops.virtual_aperture.use_lens_preset(filepath=file) == {"FINISHED"}

    def people(self) -> None:
        first_found(self.settings, (None, self.r.choice([None, self.r.uniform(0.1, 0.5)])))

    def solve(self) -> None:
        old = reconstruction_of(self.settings)
        new = scaled(old, 3.0 if old.typical_depth < 20 else 1 / 3)
        kept = keep_focus(self.settings, self.clip)
        build(self.scene, open_footage(self.clip), new)
        if kept is not None:
            restore_focus(self.settings, kept, new)

    def another_clip(self) -> None:
        """A radius means nothing in another scene's unit."""
        if "aperture_radius" in shown():
            return
        build(self.scene, open_footage(self.other), scaled(slanted_plane(LENS, FRAMES[:2]), 2.0))
        build(self.scene, open_footage(self.clip), slanted_plane(LENS, FRAMES))
        focus_marks.set_first(self.settings, reconstruction_of(self.settings))

    def undo(self) -> None:
        bpy.ops.ed.undo_push(message="Before")
        getattr(self, self.r.choice(["pick", "mark", "distance", "tilt", "first_subject"]))()
        bpy.ops.ed.undo_push(message="After")
        assert bpy.ops.ed.undo() == {"FINISHED"}

    def reopen(self) -> None:
        file = str(self.clip.parent / "shot.blend")
        bpy.ops.wm.save_as_mainfile(filepath=file)
        bpy.ops.wm.open_mainfile(filepath=file)


DEEDS = [name for name, deed in vars(Hands).items() if callable(deed) and name not in ("__init__", "place")]


def shown() -> dict[str, float]:
    """The amounts that the panels show as settings."""
    drawn = [*draw(panels.main.VIRTUAL_APERTURE_PT_main).props]
    drawn += draw(panels.lens.VIRTUAL_APERTURE_PT_lens).props
    settings = bpy.context.scene.virtual_aperture
    return {name: getattr(settings, name) for name in AMOUNT if name in drawn}


def radii() -> list[float]:
    """The aperture's radius of each frame, as a render has it."""
    found, now = [], bpy.context.scene.frame_current
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        evaluated = bpy.context.evaluated_depsgraph_get().scene_eval.virtual_aperture
        found.append(frame_options(evaluated, reconstruction_of(bpy.context.scene.virtual_aperture)).radius)
    bpy.context.scene.frame_set(now)
    return found


@pytest.mark.parametrize("kind", ["fixed", "zoom"])
@pytest.mark.parametrize("seed", variants(range(12), 3))
def test_an_amount_changes_by_its_own_setters_alone(
    scene: bpy.types.Scene, tmp_path: Path, seed: int, kind: str
) -> None:
    r = random.Random(seed)
    plane = slanted_plane(LENS, FRAMES)
    clip = write_frames(tmp_path / "clip", LENS, FRAMES)
    build(scene, open_footage(clip), zooming(plane) if kind == "zoom" else plane)
    hands, done, name = Hands(clip, r), [], "blur_percent"
    focus_marks.set_first(scene.virtual_aperture, plane)
    expected = {"blur_percent": scene.virtual_aperture.blur_percent}
    assert expected == {"blur_percent": pytest.approx(3.0)}
    for _ in range(40):
        if r.random() < 0.1:
            name = r.choice(AMOUNT)
            value = {"blur_percent": r.uniform(0.5, 8), "f_stop": r.uniform(0.2, 8)}.get(
                name, r.uniform(0.05, 0.5)
            )
            setattr(hands.settings, name, value)
            expected = {name: value}
            done = [name]
        deed = r.choice(DEEDS)
        getattr(hands, deed)()
        done.append(deed)
        if deed == "solve" and name == "aperture_radius":
            # A length in another unit, which a fit of the features gives.
            ratio = hands.settings.aperture_radius / expected[name]
            assert min(abs(ratio / 3 - 1), abs(3 * ratio - 1)) < 0.01
            expected[name] = hands.settings.aperture_radius
        assert shown() == {name: pytest.approx(expected[name], rel=1e-5)}, done
        if r.random() < 0.2:
            assert np.ptp(radii()) <= 1e-5 * max(radii()), (done, radii())


def test_a_pick_in_front_of_a_far_focus_keeps_the_blur(scene: bpy.types.Scene, tmp_path: Path) -> None:
    """The automatic focus was far behind; a click on what is near had blurred the background 8 times more."""
    plane = slanted_plane(LENS, FRAMES)
    settings = build(scene, open_footage(write_frames(tmp_path / "clip", LENS, FRAMES)), plane)
    far, near = (Place(Focus(distance=d), 1, d, "") for d in (11.4, 5.2))
    focus_marks.put_first(settings, far)
    assert settings.blur_percent == pytest.approx(3.0)
    focus_on(settings, 1, [near])
    assert settings.blur_percent == pytest.approx(3.0)
    true = radius_for_blur(plane, Focus(distance=5.2), 1, 0.03)
    assert radii() == [pytest.approx(true, rel=1e-5)] * len(FRAMES)
    # A second mark looks through the same lens, and so does a scrub.
    focus_marks.put(settings, 6, [Place(Focus(distance=11.0), 6, 11.0, "")], add=True)
    assert radii() == [pytest.approx(true, rel=1e-5)] * len(FRAMES)
    scene.frame_set(6)
    assert settings.blur_percent == pytest.approx(3.0)
    # A stored aperture stays what it is.
    settings.f_stop = 2.0
    radius = settings.aperture_radius
    focus_on(settings, 1, [far])
    assert settings.aperture_radius == radius and settings.f_stop == pytest.approx(2.0)


def test_an_own_preset_of_before_leaves_the_blur(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = build(
        scene, open_footage(write_frames(tmp_path / "clip", LENS, FRAMES)), slanted_plane(LENS, FRAMES)
    )
    settings.focus_distance, settings.blur_percent = 8.0, 10.0
    file = tmp_path / "mine.py"
    file.write_text(
        "import bpy\ns = bpy.context.scene.virtual_aperture\n"
        "s.shape.blades = 7\ns.blur = 0.0241\ns.f_stop = 2.0\n"
    )
    for name in ("blur_percent", "aperture_radius"):
        value = getattr(settings, name)
        setattr(settings, name, value)
        bpy.ops.virtual_aperture.use_lens_preset(filepath=str(file))
        assert settings.shape.blades == 7 and getattr(settings, name) == pytest.approx(value)
        assert set(shown()) == {name}
    settings.f_stop = 5.6
    bpy.ops.virtual_aperture.use_lens_preset(filepath=str(file))
    assert shown() == {"f_stop": pytest.approx(2.0)}
