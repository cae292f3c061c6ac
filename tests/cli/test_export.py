"""Exports for other programs: two layers and STMaps, as Blender's own compositor reads them."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.frame.passes import INFINITE
from addon.core.media.exr_file import write_exr
from addon.core.media.light import to_linear

from ..command_line import done, here
from ..pictures import channels
from .solved_clips import PLANES_LENS, import_planes

LOOK = ("--focus-distance", 6, "--aperture-radius", 0.25, "--highlights", "off")
SIZE = PLANES_LENS.width, PLANES_LENS.height


@pytest.fixture(scope="module")
def work(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return import_planes(tmp_path_factory.mktemp("known"))


@pytest.fixture(scope="module")
def layers(work: Path) -> Path:
    """Frame 5 in two layers."""
    out = work.parent / "layers"
    done("export", work, "--what", "layers", *LOOK, "--frames", "5", "--out", out)
    return out / "layers_0005.exr"


@pytest.fixture
def tree(registered: None) -> bpy.types.NodeTree:
    """The compositor of a scene that renders nothing else, at the planes' size."""
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    made = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
    scene.compositing_node_group = made
    made.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    made.nodes.new("NodeGroupOutput")
    scene.collection.objects.link(camera := bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    scene.camera = camera
    render = scene.render
    render.engine, render.resolution_percentage = "CYCLES", 100
    render.resolution_x, render.resolution_y = SIZE
    render.compositor_device, render.compositor_precision = "CPU", "FULL"
    settings = render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    settings.exr_codec = "NONE"
    return made


def shown(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, file: Path) -> np.ndarray:
    """(H, W, 4) what the compositor makes of a socket."""
    tree.links.new(socket, tree.nodes["Group Output"].inputs[0])
    bpy.context.scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    found = channels(file)
    return np.stack([found[name] for name in "RGBA"], axis=-1)


def layer_node(tree: bpy.types.NodeTree, file: Path, layer: str) -> bpy.types.Node:
    node = tree.nodes.new("CompositorNodeImage")
    node.image = bpy.data.images.load(str(file))
    node.layer = layer
    return node


def test_two_layers_are_the_frame_and_what_it_hides(
    work: Path, layers: Path, tree: bpy.types.NodeTree, tmp_path: Path
) -> None:
    front, hidden = (layer_node(tree, layers, name) for name in ("Front", "Hidden"))
    assert [each.name for each in front.outputs] == ["Combined", "Alpha", "Depth"]
    seen, behind = (
        shown(tree, node.outputs["Combined"], tmp_path / f"{node.layer}.exr") for node in (front, hidden)
    )
    near, far = (
        shown(tree, node.outputs["Depth"], tmp_path / f"{node.layer}_z.exr")[..., 0]
        for node in (front, hidden)
    )
    picture = cv2.imread(str(work.parent / "clip" / "shot_0005.png"))[..., ::-1]
    whole = seen + (1 - seen[..., 3:]) * behind
    # What is seen is the clip's own picture, and its silhouettes are those of two surfaces.
    np.testing.assert_allclose(whole, to_linear(picture), atol=1e-6)
    is_mixed = seen[..., 3] < 1
    assert 0.001 < is_mixed.mean() < 0.1 and (behind[is_mixed, 3] == 1).all()
    # The planes' depths are 10, 6 and 4, and behind a plane lies one farther away.
    assert [np.abs(near / depth - 1).min() < 0.02 for depth in (10, 6, 4)] == [True] * 3
    is_hidden = behind[..., 3] > 0
    assert 0.05 < is_hidden.mean() < 0.6 and (far[is_hidden] > 1.1 * near[is_hidden]).mean() > 0.95
    assert np.median(far[is_hidden]) == pytest.approx(10, rel=0.05)
    assert (far[~is_hidden] == np.float32(INFINITE)).all()


def test_channels_are_read_to_the_bit(tree: bpy.types.NodeTree, tmp_path: Path) -> None:
    random, (width, height) = np.random.default_rng(1), SIZE
    # Noise, which no compression makes shorter, and a ramp, whose rows it does.
    made = {f"Front.Combined.{each}": random.normal(size=(height, width)).astype("f4") for each in "RGBA"}
    made["Front.Combined.A"][:] = 1
    made["Front.Depth.Z"] = np.add.outer(np.arange(height), np.arange(width) / 7).astype("f4")
    made["Hidden.Combined.R"] = made["Front.Depth.Z"].astype("f2")
    made |= {f"Hidden.Combined.{each}": made["Hidden.Combined.R"] for each in "GBA"}
    write_exr(tmp_path / "made.exr", made)
    node = layer_node(tree, tmp_path / "made.exr", "Front")
    colour = shown(tree, node.outputs["Combined"], tmp_path / "colour.exr")
    np.testing.assert_array_equal(colour, np.stack([made[f"Front.Combined.{each}"] for each in "RGBA"], -1))
    depth = shown(tree, node.outputs["Depth"], tmp_path / "depth.exr")
    np.testing.assert_array_equal(depth[..., 0], made["Front.Depth.Z"])
    other = layer_node(tree, tmp_path / "made.exr", "Hidden")
    half = shown(tree, other.outputs["Combined"], tmp_path / "half.exr")
    np.testing.assert_array_equal(half[..., 2], made["Hidden.Combined.B"].astype("f4"))


def test_nothing_is_overwritten_and_nothing_is_left(work: Path, layers: Path, tmp_path: Path) -> None:
    command = ("export", work, "--what", "layers", *LOOK, "--frames", "5", "--out", layers.parent)
    before = layers.read_bytes()
    again = here(*command)
    assert again.returncode == 1 and "already exists" in again.stderr
    assert layers.read_bytes() == before and [each.name for each in layers.parent.iterdir()] == [layers.name]
    done(*command, "--overwrite")
    assert layers.read_bytes() == before
    for words, why in (
        (("--what", "layers", "--out", tmp_path / "a"), "--focus-at"),
        (("--what", "stmap"), "--what needs --out"),
        (("--model", tmp_path / "model", "--out", tmp_path), "takes no other options"),
        (("--out", tmp_path / "a"), "--what --model"),
    ):
        refused = here("export", work, *words)
        assert refused.returncode == 2 and why in refused.stderr, refused.stderr
    among = here("export", work, "--what", "stmap", "--out", work.parent / "clip")
    assert among.returncode == 1 and "the files the frames are made from" in among.stderr
    # A frame whose blur is too large for layers.
    wide = (*LOOK[:3], 40, *LOOK[4:], "--frames", "5", "--out", tmp_path / "wide")
    large = here("export", work, "--what", "layers", *wide)
    assert large.returncode == 1 and "cannot be exported in layers" in large.stderr
    assert not list((tmp_path / "wide").glob("*"))
