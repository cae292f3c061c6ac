"""Objects of a solve that users delete, and scenes that they copy, link and append."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import pytest

from addon.core.camera.reconstruction import Intrinsics
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import
from addon.scene import parts
from addon.scene.build import build
from addon.scene.sources.shot import reconstruction_of, shot_of
from addon.ui import panels
from addon.ui.footage.solve import build_scene

from ..recorder import draw
from ..scenes import slanted_plane, slanted_shot

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
DETAILS = panels.notices.VIRTUAL_APERTURE_PT_details


def solved(scene: bpy.types.Scene, folder: Path, name: str = "clip") -> bpy.types.PropertyGroup:
    """A scene with a clip's solve, which a working folder keeps; in focus, quick to render."""
    made = slanted_shot(folder / name, LENS)
    work = folder / f"{name}.aperture"
    keep_import(Imported(made.reconstruction, "true cameras", ()), made.footage, work)
    settings = scene.virtual_aperture
    settings.footage, settings.work_dir = str(made.footage.path), str(work)
    build_scene(scene, made.footage, work)
    settings.views, settings.focus_distance, settings.method = 4, 8.0, "features"
    return settings


def render(folder: Path) -> bytes:
    """The present scene's frame by our operator, as its pixels' bytes."""
    bpy.context.scene.render.filepath = str(folder / "frame.png")
    assert bpy.ops.virtual_aperture.render_frame() == {"FINISHED"}
    bpy.data.images["Render Result"].save_render(str(folder / "frame.png"))
    return cv2.imread(str(folder / "frame.png"), cv2.IMREAD_UNCHANGED).tobytes()


def delete(thing: bpy.types.Object) -> None:
    """As X in the viewport does it: our property keeps it alive."""
    with bpy.context.temp_override(selected_objects=[thing]):
        bpy.ops.object.delete()


@pytest.mark.parametrize(
    ("name", "how"),
    [
        ("root", "deleted"),
        ("camera", "purged"),
        ("points", "deleted"),
        ("points", "purged"),
        ("aperture", "deleted"),
    ],
)
def test_what_was_deleted_is_restored(scene: bpy.types.Scene, tmp_path: Path, name: str, how: str) -> None:
    settings = solved(scene, tmp_path)
    expected = render(tmp_path)
    places, radius = settings.camera.matrix_world.copy(), settings.aperture_radius
    assert parts.missing(scene) == []
    with pytest.raises(RuntimeError, match="No objects of the solve are missing"):
        bpy.ops.virtual_aperture.restore_objects()
    if how == "deleted":
        delete(getattr(settings, name))
    else:
        bpy.data.objects.remove(getattr(settings, name))
    assert parts.missing(scene) == [parts.PARTS[name]]
    shown = draw(DETAILS)
    said = "The clip's camera was deleted" if name == "camera" else "The objects of this solve were deleted"
    assert said in " ".join(shown.texts)
    assert "virtual_aperture.restore_objects" in shown.operators
    # Nothing is half there: the same picture, or a word why not.
    if name in ("root", "aperture") or (name == "points" and how == "deleted"):
        assert render(tmp_path) == expected
    else:
        with pytest.raises(RuntimeError, match=r"deleted|Solve the clip"):
            bpy.ops.virtual_aperture.render_frame()
    assert bpy.ops.virtual_aperture.restore_objects() == {"FINISHED"}
    assert parts.missing(scene) == [] and scene.camera == settings.camera
    assert settings.points.parent == settings.camera.parent == settings.root
    bpy.context.view_layer.update()
    assert settings.camera.matrix_world == places
    settings.focus_distance, settings.aperture_radius = 8.0, radius
    assert render(tmp_path) == expected


def test_what_cannot_be_restored_is_said(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = solved(scene, tmp_path)
    settings.work_dir = str(tmp_path / "elsewhere")
    bpy.data.meshes.remove(settings.points.data)
    with pytest.raises(
        RuntimeError, match="the point cloud was deleted, and the solve with it; solve the clip"
    ):
        bpy.ops.virtual_aperture.restore_objects()


def test_points_that_cannot_be_edited_say_why(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = solved(scene, tmp_path)
    layer = bpy.context.view_layer.layer_collection.children["Virtual Aperture"]
    layer.exclude = True
    with pytest.raises(RuntimeError, match="collection is excluded from the view layer"):
        bpy.ops.virtual_aperture.set_focus()
    layer.exclude = False
    delete(settings.points)
    with pytest.raises(RuntimeError, match="The point cloud was deleted; Restore Objects"):
        bpy.ops.virtual_aperture.set_focus()


def test_names_do_not_matter(scene: bpy.types.Scene, tmp_path: Path) -> None:
    settings = solved(scene, tmp_path)
    expected = render(tmp_path)
    for name in parts.PARTS:
        getattr(settings, name).name = f"my {name}"
    scene.name = settings.camera.users_collection[0].name = "mine"
    assert parts.missing(scene) == [] and render(tmp_path) == expected
    count = len(bpy.data.objects)
    build_scene(scene, shot_of(scene).footage, tmp_path / "clip.aperture")
    assert len(bpy.data.objects) == count and settings.points.name == "my points"


@pytest.mark.parametrize("kind", ["FULL_COPY", "LINK_COPY", "EMPTY"])
def test_a_copied_scene_gets_its_own_solve(scene: bpy.types.Scene, tmp_path: Path, kind: str) -> None:
    """Another clip solved in the copy leaves the first scene as it was."""
    settings = solved(scene, tmp_path)
    expected, mine = render(tmp_path), [getattr(settings, name) for name in parts.PARTS]
    bpy.ops.scene.new(type=kind)
    copy = bpy.context.scene
    assert copy != scene
    if kind == "EMPTY":
        assert len(parts.missing(copy)) == len(parts.PARTS)
        assert bpy.ops.virtual_aperture.restore_objects() == {"FINISHED"}
    assert parts.missing(copy) == []
    assert render(tmp_path) == expected
    other = slanted_shot(tmp_path / "other", LENS, (1, 2))
    build(copy, other.footage, slanted_plane(LENS, (1, 2), near=2.0, count=90))
    theirs = copy.virtual_aperture
    assert len(theirs.points.data.vertices) == 90 and parts.missing(copy) == []
    assert not {getattr(theirs, name) for name in parts.PARTS} & set(mine)
    assert not set(mine) & set(copy.objects)
    bpy.context.window.scene = scene
    assert [getattr(settings, name) for name in parts.PARTS] == mine
    assert len(reconstruction_of(settings).points) == 150
    assert render(tmp_path) == expected


@pytest.fixture
def source(scene: bpy.types.Scene, tmp_path: Path) -> tuple[Path, bytes]:
    """A .blend with a solved scene, its clip beside it, in a folder of its own; and its picture."""
    folder = tmp_path / "there"
    folder.mkdir()
    scene.name = "Shot"
    solved(scene, folder)
    expected = render(tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    assert scene.virtual_aperture.footage == "//clip"
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    (tmp_path / "here").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "here" / "edit.blend"))
    return folder / "shot.blend", expected


def test_an_appended_scene_finds_its_clip(source: tuple[Path, bytes], tmp_path: Path) -> None:
    blend, expected = source
    bpy.ops.wm.append(directory=f"{blend}/Scene/", filename="Shot")
    appended = bpy.data.scenes["Shot"]
    assert appended.virtual_aperture.footage == "//../there/clip"
    assert appended.virtual_aperture.work_dir == "//../there/clip.aperture"
    bpy.context.window.scene = appended
    assert render(tmp_path) == expected
    assert parts.missing(appended) == []


def test_a_linked_scene_renders_and_is_not_changed(source: tuple[Path, bytes], tmp_path: Path) -> None:
    blend, expected = source
    bpy.ops.wm.link(directory=f"{blend}/Scene/", filename="Shot")
    linked = next(each for each in bpy.data.scenes if each.library is not None)
    bpy.context.window.scene = linked
    assert render(tmp_path) == expected
    said = "Shot is linked from shot.blend; open that file, or append the scene from it"
    assert said in " ".join(draw(DETAILS).texts)
    for panel in panels.CLASSES:
        draw(panel)
    clip = str(blend.parent / "clip")
    for name, given in (
        ("choose_clip", {"filepath": clip}), ("solve", {}), ("set_focus", {}), ("set_scale", {}),
        ("find_clip", {"filepath": clip}), ("import_solve", {"filepath": clip}),
        ("import_movie_clip", {}), ("import_clip", {"filepath": clip}), ("drop_model", {"filepath": clip}),
        ("restore_objects", {}), ("use_lens_preset", {"filepath": clip}),
    ):  # fmt: skip
        with pytest.raises(RuntimeError, match=r"is linked from shot\.blend"):
            getattr(bpy.ops.virtual_aperture, name)(**given)
    # Made local alone, it gets objects of its own with its next solve.
    footage = shot_of(linked).footage
    # It is copied, as the linked camera's driver still refers to it.
    linked = linked.make_local()
    assert linked.library is None
    made = build(linked, footage, slanted_plane(LENS))
    assert made.points.library is None and parts.missing(linked) == []
