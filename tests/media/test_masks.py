"""The user's masks: pictures, Blender's datablock, and both on their way into a shot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import Map
from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Intrinsics
from addon.core.media.clip import Footage, open_footage
from addon.core.media.masks import open_masks
from addon.render.views.quiet import quiet
from addon.scene.build import build
from addon.scene.sources.masks import drawn_mask, follows_tracks, layers_of
from addon.scene.sources.shot import shot_of
from sample_scenes.cycles_views import render_to_array

from ..scenes import slanted_shot, write_frames

WIDTH, HEIGHT = 64, 48
LENS = Intrinsics(WIDTH, HEIGHT, 60.0, 60.0, WIDTH / 2, HEIGHT / 2)
FRAMES = (3, 4, 5)
BOX = np.s_[10:30, 20:44]

Bytes = NDArray[np.uint8]


@pytest.fixture
def clip(tmp_path: Path) -> Footage:
    return open_footage(write_frames(tmp_path / "clip", LENS, FRAMES))


def white_box(size: tuple[int, int] = (WIDTH, HEIGHT), white: float = 255, kind: str = "uint8") -> Any:
    """(h, w) `white` in the box and 0 around it."""
    picture = np.zeros((HEIGHT, WIDTH), np.uint8)
    picture[BOX] = 1
    return cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST).astype(kind) * np.array(white, kind)


TRUE = white_box() > 0


def write_masks(folder: Path, frames: tuple[int, ...] = FRAMES, name: str = "mask_{:04d}.png") -> Path:
    folder.mkdir()
    for frame in frames:
        assert cv2.imwrite(str(folder / name.format(frame)), white_box())
    return folder


@pytest.mark.parametrize("given", ["", "mask_####.png", "mask_%04d.png", "mask_0004.png"])
def test_a_folder_a_pattern_or_one_of_the_pictures(clip: Footage, tmp_path: Path, given: str) -> None:
    masks = open_masks(write_masks(tmp_path / "masks") / given, clip)
    assert masks.frames == FRAMES and not masks.notes
    for frame in FRAMES:
        found = masks.at(frame)
        assert found is not None
        np.testing.assert_array_equal(found, TRUE)


def test_frames_without_a_mask_are_unknown(clip: Footage, tmp_path: Path) -> None:
    masks = open_masks(write_masks(tmp_path / "masks", (4,)), clip)
    assert masks.at(3) is None and masks.at(4) is not None
    assert "2 of 3 frames without a mask" in masks.notes[0]


def test_other_numbers_in_order_but_not_other_counts(clip: Footage, tmp_path: Path) -> None:
    masks = open_masks(write_masks(tmp_path / "shifted", (0, 1, 2)), clip)
    assert masks.numbers == {3: 0, 4: 1, 5: 2} and "in order" in masks.notes[0]
    with pytest.raises(UserError, match=r"masks are frames 20 to 23.*clip has frames 3 to 5.*number them"):
        open_masks(write_masks(tmp_path / "others", (20, 21, 22, 23)), clip)


def test_any_size(clip: Footage, tmp_path: Path) -> None:
    (tmp_path / "m").mkdir()
    for frame in FRAMES:
        cv2.imwrite(str(tmp_path / "m" / f"{frame}.png"), white_box((100, 75)))
    found = open_masks(tmp_path / "m", clip).at(4)
    assert found is not None and found.shape == TRUE.shape
    assert ((found > 0.5) & TRUE).sum() > 0.9 * ((found > 0.5) | TRUE).sum()


def test_another_shape_is_said(clip: Footage, tmp_path: Path) -> None:
    (tmp_path / "m").mkdir()
    for frame in FRAMES:
        cv2.imwrite(str(tmp_path / "m" / f"{frame}.png"), white_box((64, 64)))
    assert "stretched over 64x48" in open_masks(tmp_path / "m", clip).notes[0]


def test_every_kind_of_picture(clip: Footage, tmp_path: Path) -> None:
    box = white_box()
    colour = np.dstack([box, box, box])
    kinds: dict[str, tuple[str, NDArray[np.generic]]] = {
        "16 bits": ("png", white_box(white=65535, kind="uint16")),
        "colour": ("png", colour),
        "transparent": ("png", np.dstack([np.full_like(colour, 255), box])),
        "jpeg": ("jpg", colour),
        "float": ("tif", white_box(white=1, kind="float32")),
    }
    for name, (suffix, picture) in kinds.items():
        (tmp_path / name).mkdir()
        for frame in FRAMES:
            assert cv2.imwrite(str(tmp_path / name / f"{frame}.{suffix}"), picture)
        found = open_masks(tmp_path / name, clip).at(4)
        assert found is not None, name
        np.testing.assert_allclose(found, TRUE, atol=0.03 if suffix == "jpg" else 0, err_msg=name)


def test_what_is_between_white_and_black_is_opacity(clip: Footage, tmp_path: Path) -> None:
    ramp = np.tile(np.linspace(0, 255, WIDTH).round().astype(np.uint8), (HEIGHT, 1))
    cut_out = np.random.default_rng(1).integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
    linear = (ramp / 255).astype(np.float32)
    kinds: dict[str, tuple[str, NDArray[np.generic]]] = {
        "grey": ("png", ramp),
        "a cut-out": ("png", np.dstack([cut_out, ramp])),
        "float": ("tif", linear),
        "a premultiplied cut-out": (
            "tif",
            np.dstack([linear[..., None] * 0.2 * np.ones(3, np.float32), linear]),
        ),
        "opaque": ("png", np.dstack([ramp, ramp, ramp, np.full_like(ramp, 255)])),
    }
    for name, (suffix, picture) in kinds.items():
        (tmp_path / name).mkdir()
        for frame in FRAMES:
            assert cv2.imwrite(str(tmp_path / name / f"{frame}.{suffix}"), picture)
        found = open_masks(tmp_path / name, clip).at(4)
        assert found is not None and found.dtype == np.float32, name
        np.testing.assert_allclose(found, ramp / 255, atol=1e-3, err_msg=name)


def test_what_cannot_be_read_is_named(clip: Footage, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"masks: .*nothing does not exist"):
        open_masks(tmp_path / "nothing", clip)
    cv2.imwrite(str(tmp_path / "mask.png"), white_box())
    with pytest.raises(UserError, match=r"mask.png has no frame number; name masks like mask_0001.png"):
        open_masks(tmp_path / "mask.png", clip)
    folder = write_masks(tmp_path / "masks")
    (folder / "mask_0004.png").write_bytes(b"no picture")
    with pytest.raises(UserError, match=r"masks: mask_0004.png cannot be decoded"):
        open_masks(folder, clip).at(4)


def ring(
    mask: bpy.types.Mask, centre: tuple[float, float], radius: float, blend: str, count: int = 6
) -> None:
    """A wavy closed curve on a layer of its own."""
    layer = mask.layers.new(name=blend)
    layer.blend = blend
    spline = layer.splines.new()
    spline.use_cyclic = True
    spline.points.add(count - len(spline.points))
    for k, point in enumerate(spline.points):
        angle = 2 * np.pi * k / count
        reach = radius * (1 + 0.3 * np.sin(3 * k))
        point.co = centre[0] + reach * np.cos(angle), centre[1] + reach * np.sin(angle)
        point.handle_type = "VECTOR" if blend == "SUBTRACT" else "AUTO"


def key(mask: bpy.types.Mask, frame: int, shift: float) -> None:
    """Move all points and set a shape key, as a user does."""
    bpy.context.scene.frame_set(frame)
    for layer in mask.layers:
        for point in layer.splines[0].points:
            point.co = point.co[0] + shift, point.co[1]
            point.select = point.select_control_point = True
    area = bpy.context.screen.areas[0]
    kind, area.type = area.type, "IMAGE_EDITOR"
    space = area.spaces.active
    space.mode, space.mask = "MASK", mask
    window = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(area=area, region=window, space_data=space):
        assert bpy.ops.mask.shape_key_insert() == {"FINISHED"}
    area.type = kind


def composited(scene: bpy.types.Scene, mask: bpy.types.Mask, size: tuple[int, int], path: Path) -> Map:
    """(H, W) the same by Blender's own compositor."""
    tree = bpy.data.node_groups.new("mask", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    node, out = tree.nodes.new("CompositorNodeMask"), tree.nodes.new("NodeGroupOutput")
    node.mask = mask
    node.inputs["Feather"].default_value = True
    tree.links.new(node.outputs[0], out.inputs[0])
    scene.compositing_node_group = tree
    if scene.camera is None:
        scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        scene.collection.objects.link(scene.camera)
    render = scene.render
    render.engine, scene.cycles.samples = "CYCLES", 1
    render.resolution_x, render.resolution_y = size
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    with quiet(1), quiet(2):
        picture = render_to_array(scene, path)
    return np.asarray(picture[..., 0])


@pytest.mark.parametrize("size", [(192, 108), (108, 192)], ids=["wide", "tall"])
def test_a_drawn_mask_is_what_the_compositor_makes_of_it(
    scene: bpy.types.Scene, tmp_path: Path, size: tuple[int, int]
) -> None:
    mask = bpy.data.masks.new("moving")
    ring(mask, (0.4, 0.5), 0.2, "MERGE_ADD")
    ring(mask, (0.6, 0.45), 0.15, "ADD")
    ring(mask, (0.45, 0.5), 0.08, "SUBTRACT")
    ring(mask, (0.7, 0.55), 0.1, "DIFFERENCE")
    key(mask, 3, 0.0)
    key(mask, 5, 0.1)
    drawn = drawn_mask(mask, FRAMES, size)
    edge = np.ones((3, 3), np.uint8)
    for frame in FRAMES:
        scene.frame_set(frame)
        true = (composited(scene, mask, size, tmp_path / f"{frame}.exr") > 0.5).astype(np.uint8)
        found = drawn.at(frame)
        assert found is not None and 0.05 < found.mean() < 0.5
        found = found > 0.5
        # The same but for the pixels on the outline.
        inside, outside = cv2.erode(true, edge) > 0, cv2.dilate(true, edge) == 0
        assert found[inside].all() and not found[outside].any()
    assert drawn.at(6) is None
    one, other = drawn.at(3), drawn.at(5)
    assert one is not None and other is not None
    shift = round(0.1 * max(size))
    moved, other = one[:, :-shift] > 0.5, other[:, shift:] > 0.5
    assert (moved & other).sum() > 0.95 * (moved | other).sum()


@pytest.mark.parametrize("falloff", ["SMOOTH", "ROOT", "SHARP"])
def test_feather_is_what_the_compositor_makes_of_it(
    scene: bpy.types.Scene, tmp_path: Path, falloff: str
) -> None:
    mask, size = bpy.data.masks.new("moving"), (192, 108)
    ring(mask, (0.45, 0.5), 0.15, "MERGE_ADD", count=9)
    layer = mask.layers[0]
    layer.falloff = falloff
    points = layer.splines[0].points
    for number, (point, place) in enumerate(zip(points, [tuple(each.co) for each in points], strict=True)):
        point.weight = 0.03 + 0.05 * (number % 3 == 0)
        # Clockwise, or the feather lies within.
        points[-number].co = place
    scene.frame_set(1)
    true, found = composited(scene, mask, size, tmp_path / "a.exr"), drawn_mask(mask, (1,), size).at(1)
    assert found is not None
    fraction = (true > 0.02) & (true < 0.98)
    assert fraction.mean() > 0.08
    off = np.abs(found - true)
    print(falloff, off[fraction].mean(), np.quantile(off[fraction], 0.95), np.mean(off[~fraction] > 0.1))
    assert off[fraction].mean() < 0.04 and np.quantile(off[fraction], 0.95) < 0.15
    # Steep falloffs end in a step, which is a pixel off where the feather's width changes.
    assert np.mean(off[~fraction] > 0.1) < 0.005


def test_drawing_leaves_the_users_scene_alone(scene: bpy.types.Scene) -> None:
    mask = bpy.data.masks.new("moving")
    ring(mask, (0.4, 0.5), 0.2, "MERGE_ADD")
    key(mask, 3, 0.0)
    key(mask, 5, 0.1)
    scene.frame_set(4)
    before = [tuple(point.co) for point in mask.layers[0].splines[0].points]
    drawn_mask(mask, FRAMES, (64, 48))
    assert [s.name for s in bpy.data.scenes] == [scene.name] and scene.frame_current == 4
    assert [tuple(point.co) for point in mask.layers[0].splines[0].points] == before


def test_layers_that_are_hidden_inverted_or_open(scene: bpy.types.Scene) -> None:
    mask = bpy.data.masks.new("moving")
    ring(mask, (0.5, 0.5), 0.2, "MERGE_ADD")
    size = (64, 64)

    def shown() -> Map:
        found = drawn_mask(mask, (1,), size).at(1)
        assert found is not None
        return found

    plain = shown()
    mask.layers[0].invert = True
    np.testing.assert_allclose(shown(), 1 - plain, atol=1e-6)
    mask.layers[0].invert, mask.layers[0].hide_render = False, True
    assert not shown().any()
    mask.layers[0].hide_render, mask.layers[0].alpha = False, 0.4
    np.testing.assert_allclose(shown(), 0.4 * plain, atol=1e-6)
    mask.layers[0].alpha = 1.0
    mask.layers[0].splines[0].use_fill = False
    assert not shown().any()
    assert drawn_mask(bpy.data.masks.new("empty"), (1,), size).at(1) is not None
    assert not follows_tracks(mask)


def test_a_mask_that_was_redrawn_is_taken_again(scene: bpy.types.Scene) -> None:
    mask = bpy.data.masks.new("moving")
    ring(mask, (0.5, 0.5), 0.2, "MERGE_ADD")
    scene.frame_set(1)
    drawn = drawn_mask(mask, (1,), (64, 48))

    def evaluated() -> bpy.types.Mask:
        return mask.evaluated_get(bpy.context.evaluated_depsgraph_get())

    assert drawn.is_still(evaluated(), 1)
    assert layers_of(evaluated())[0].blend == "MERGE_ADD"
    mask.layers[0].splines[0].points[0].co = (0.9, 0.5)
    scene.frame_set(1)
    assert not drawn.is_still(evaluated(), 1)


def test_a_shot_has_both_masks(scene: bpy.types.Scene, tmp_path: Path) -> None:
    shot = slanted_shot(tmp_path / "clip", LENS, FRAMES)
    settings = build(scene, shot.footage, shot.reconstruction)
    assert shot_of(scene).clip.masked(4) is None
    settings.masks = str(write_masks(tmp_path / "masks", (4, 5)))
    settings.mask = bpy.data.masks.new("moving")
    ring(settings.mask, (0.85, 0.2), 0.1, "MERGE_ADD")
    both = shot_of(scene)
    drawn = drawn_mask(settings.mask, FRAMES, (WIDTH, HEIGHT)).at(3)
    alone, together = both.clip.masked(3), both.clip.masked(4)
    assert drawn is not None and drawn.any() and alone is not None and together is not None
    np.testing.assert_array_equal(alone, drawn)
    np.testing.assert_array_equal(together, np.maximum(drawn, TRUE))
    assert shot_of(scene) is both
    # What the user says moves is not lent and has no part in depth.
    assert both.context.stereo.at(4).moving[TRUE].mean() > 0.95
    settings.mask = None
    again = shot_of(scene).clip.masked(4)
    assert again is not None
    np.testing.assert_array_equal(again, TRUE)
