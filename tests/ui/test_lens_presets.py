"""Presets of the lens through Blender's own system."""

from __future__ import annotations

import re
from dataclasses import asdict
from pathlib import Path

import bpy
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.frame.options import APERTURE_OPTIONS
from addon.scene.build import build
from addon.ui.focus.bokeh import preset_aperture, preset_icon
from addon.ui.focus.lens_presets import ROOT, VIRTUAL_APERTURE_PT_lens_presets

from ..recorder import draw
from ..scenes import slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
SUBDIR = VIRTUAL_APERTURE_PT_lens_presets.preset_subdir
SHIPPED = sorted((ROOT / "presets" / SUBDIR).glob("*.py"))
SIZE = re.compile(r"(\d+)_mm_.*f_slash_([\d.]+)\.py")


@pytest.fixture
def settings(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.PropertyGroup:
    made = slanted_shot(tmp_path, LENS)
    found = build(scene, made.footage, made.reconstruction)
    found.focus_distance = 8.0
    return found


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the user's presets of lenses, an empty one."""
    monkeypatch.setenv("BLENDER_USER_SCRIPTS", str(tmp_path / "scripts"))
    (tmp_path / "scripts").mkdir()
    return tmp_path / "scripts" / "presets" / SUBDIR


def values(group: bpy.types.PropertyGroup) -> dict[str, object]:
    names = [p.identifier for p in group.bl_rna.properties if p.type not in {"POINTER", "COLLECTION"}]
    return {name: getattr(group, name) for name in names}


def use(file: Path) -> None:
    assert bpy.ops.virtual_aperture.use_lens_preset(filepath=str(file)) == {"FINISHED"}


def test_shipped_presets_are_found() -> None:
    assert len(SHIPPED) >= 8
    names = {bpy.path.display_name(str(file), title_case=False) for file in SHIPPED}
    assert {"50 mm f/1.4", "85 mm f/1.2", "500 mm Mirror f/8", "Look: Creamy"} <= names


def test_registered_where_blender_looks(registered: None) -> None:
    assert str(ROOT / "presets" / SUBDIR) in bpy.utils.preset_paths(SUBDIR)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_a_preset_sets_the_lens_and_nothing_else(settings: bpy.types.PropertyGroup, file: Path) -> None:
    settings.highlights = 0.5
    for name in APERTURE_OPTIONS:
        setattr(settings.shape, name, 3)
    settings.shape.image = str(file)
    before = values(settings)
    use(file)
    after = values(settings)
    changed = {name for name in before if before[name] != after[name]}
    assert changed <= {"highlights", "highlight_boost"}
    # What its picture shows: nothing is left of the lens before.
    pictured, seen = (asdict(shape) for shape in (preset_aperture(file), settings.shape.aperture))
    assert pictured == pytest.approx(seen)
    # The aperture only if it was set by its f-stop.
    settings.aperture_radius = 0.1
    use(file)
    assert settings.aperture_radius == pytest.approx(0.1)
    settings.f_stop = 3.3
    use(file)
    size = SIZE.fullmatch(file.name)
    assert settings.f_stop == pytest.approx(float(size[2]) if size else 3.3)


def test_a_stored_f_stop_is_replaced(settings: bpy.types.PropertyGroup) -> None:
    settings.metres_per_unit, settings.f_stop = 0.25, 8.0
    use(next(file for file in SHIPPED if file.name == "50_mm_f_slash_1.4.py"))
    assert settings.f_stop == pytest.approx(1.4)
    assert settings.aperture_radius == pytest.approx(0.0315 / 2.8 / 0.25, rel=1e-5)


def test_virtual_cameras_follow_a_preset_once(settings: bpy.types.PropertyGroup) -> None:
    use(next(file for file in SHIPPED if "Mirror" in file.name))
    mesh = settings.aperture.data
    nearest = min(vertex.co.length for vertex in mesh.vertices)
    assert nearest > 0.3 * settings.aperture_radius


def test_own_presets_are_kept_and_removed(settings: bpy.types.PropertyGroup, own: Path) -> None:
    shape = settings.shape
    shape.blades, shape.vignetting, settings.highlights, settings.blur = 7, 0.25, 2.0, 0.04
    add = bpy.ops.virtual_aperture.add_lens_preset
    assert add(name="Mine / 1") == {"FINISHED"}
    file = next(own.iterdir())
    shape.blades, shape.vignetting, settings.highlights, settings.blur = 0, 0.0, 1.0, 0.02
    assert (preset_aperture(file).blades, preset_aperture(file).vignetting) == (7, 0.25)
    use(file)
    assert (shape.blades, shape.vignetting, settings.highlights) == (7, 0.25, 2.0)
    assert settings.blur == pytest.approx(0.02)
    assert settings.focus_distance == 8.0
    assert add(name="Mine / 1") == {"CANCELLED"}
    assert add(name="Mine / 1", remove_name=True) == {"FINISHED"}
    assert list(own.iterdir()) == []


def test_what_is_no_preset_is_refused(settings: bpy.types.PropertyGroup, tmp_path: Path) -> None:
    broken = tmp_path / "mine.py"
    broken.write_text("import bpy\nbpy.context.scene.virtual_aperture.shape.blades = 'many'\n")
    with pytest.raises(RuntimeError, match="the preset mine cannot be used: "):
        bpy.ops.virtual_aperture.use_lens_preset(filepath=str(broken))
    for text in ("this is no Python", "shape.blades = 'many'", "shape.blades = nothing()", "\0"):
        broken.write_text(text)
        assert preset_icon(broken) == 0
    assert preset_icon(tmp_path / "gone.py") == 0
    with pytest.raises(RuntimeError, match="no preset has been chosen"):
        bpy.ops.virtual_aperture.use_lens_preset()
    assert "UNDO" in bpy.types.VIRTUAL_APERTURE_OT_use_lens_preset.bl_options


def test_the_list_shows_all_presets_and_removes_own_ones_alone(
    settings: bpy.types.PropertyGroup, own: Path
) -> None:
    bpy.ops.virtual_aperture.add_lens_preset(name="Mine")
    shown = draw(VIRTUAL_APERTURE_PT_lens_presets)
    assert shown.operators.count("virtual_aperture.use_lens_preset") == len(SHIPPED) + 1
    # One that removes, and one that adds.
    assert shown.operators.count("virtual_aperture.add_lens_preset") == 2
    numbers = [int(text.split()[0]) for text in shown.texts if text[0].isdigit()]
    assert numbers == sorted(numbers) and "Mine" in shown.texts
