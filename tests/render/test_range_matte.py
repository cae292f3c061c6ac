"""The matte of a range of distances through the lens, against the closed form, and its nodes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.arrays import LinearRGBA, Map
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.source import PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.frame.range_matte import Range
from addon.core.media.light import to_linear
from addon.render.views.average import draw_matte
from addon.render.views.gpu_views import gpu_problem
from addon.scene import passes
from addon.scene.build import build
from addon.scene.passes import NAME, add_grade_nodes
from benchmarks.accuracy.scatter import disc_kernel
from benchmarks.torture import clip

from ..command_line import done
from ..pictures import channels
from ..scenes import psnr, slanted_plane, slanted_shot, texture

needs_gpu = pytest.mark.skipif(bool(gpu_problem()), reason="only CI is sure to have a GPU driver")
ROOT = Path(__file__).resolve().parents[2]
SIZE = (192, 108)
LENS = Intrinsics(*SIZE, 180.0, 180.0, 96.0, 54.0)
NEAR, FAR = 4.0, 8.0
DISC = 24
"""Pixels of the disc of what is not in focus."""


class Ball:
    """A depth source: a round thing before a wall."""

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        inverse = np.where(mask() > 0.5, 1 / NEAR, 1 / FAR).astype(np.float32)
        return PixelDepth(inverse, np.ones(SIZE[::-1], np.float32), np.zeros(SIZE[::-1], bool))

    def samples(self, frame: int, canvas: Canvas) -> None:
        return None


def mask() -> Map:
    """(H, W) what the ball covers."""
    y, x = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    return (np.hypot(x - 96, y - 54) <= 30).astype(np.float32)


def drawn(wanted: Range, focus: float, **options: object) -> Map:
    """(H, W) the matte of a frame focused at a distance."""
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), Ball())
    radius = DISC / (2 * LENS.fx * (1 / NEAR - 1 / FAR))
    lens = FrameOptions(Focus(distance=focus), radius, borrow=False, **options)
    return draw_matte(mesh_frame(clip, 2, lens, SIZE, to_linear(texture(*SIZE))).through(), wanted)


@needs_gpu
@pytest.mark.parametrize("focus", [NEAR, FAR], ids=["in focus", "out of focus"])
def test_it_is_as_blurred_as_the_picture(focus: float) -> None:
    found, true = drawn(Range(0.0, 5.0, 0.0), focus), mask()
    if focus == FAR:
        true = cv2.filter2D(true, -1, disc_kernel(DISC))
        assert psnr(found, mask()) < 20
    # Pixels of a silhouette in focus are shared by their colours, of which the ball's are the wall's.
    judged = cv2.dilate(cv2.Canny(np.uint8(255 * mask()), 50, 100), np.ones((5, 5))) == 0
    judged |= focus == FAR
    score = psnr(found[judged], true[judged])
    print(f"matte against the closed form: {score:.1f} dB")
    assert score >= 45
    # What lies behind is the rest.
    assert np.abs(drawn(Range(5.0, 0.0, 0.0), focus) + found - 1).max() < 2e-3


def test_ends_are_soft() -> None:
    matte = Range(4.0, 10.0, 0.5)
    distance = np.array([1.0, 2.0, 3.0, 4.0, 7.0, 10.0, 12.5, 15.0, 99.0, np.inf])
    assert matte.share(1 / distance) == pytest.approx([0, 0, 0.5, 1, 1, 1, 0.5, 0, 0, 0], abs=1e-6)
    assert Range(0.0, 0.0, 0.1).share(1 / distance).min() == 1
    assert Range(4.0, 0.0, 0.0).share(1 / distance).tolist() == [0, 0, 0, 1, 1, 1, 1, 1, 1, 1]


@needs_gpu
@pytest.mark.parametrize("options", [{"swing": 0.4}, {"stabilize": 0.5}], ids=["tilted", "stabilized"])
def test_distances_are_those_of_the_scene(options: dict[str, float]) -> None:
    swing = options.pop("swing", 0.0)
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(*SIZE), Ball())
    lens = FrameOptions(Focus(distance=6.0, swing=swing), 0.01, borrow=False, **options)
    warped = mesh_frame(clip, 2, lens, SIZE, to_linear(texture(*SIZE))).through()
    assert np.mean(np.abs(draw_matte(warped, Range(3.0, 5.0, 0.0)) - mask()) > 0.5) < 0.005
    assert np.mean(np.abs(draw_matte(warped, Range(7.5, 8.5, 0.0)) + mask() - 1) > 0.5) < 0.005


@pytest.fixture
def solved(scene: bpy.types.Scene, tmp_path: Path) -> bpy.types.Scene:
    shot = slanted_shot(tmp_path / "clip", Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0))
    settings = build(scene, shot.footage, shot.reconstruction)
    settings.focus_distance, settings.aperture_radius, settings.grain = 8.0, 0.4, 0.0
    settings.method, settings.views = "features", 8
    scene.frame_set(2)
    return scene


def rendered(scene: bpy.types.Scene, file: Path) -> dict[str, np.ndarray]:
    """(H, W) of each pass, and of each channel of the picture."""
    image = scene.render.image_settings
    image.media_type, image.file_format = "MULTI_LAYER_IMAGE", "OPEN_EXR_MULTILAYER"
    image.color_depth, image.exr_codec, image.use_exr_interleave = "32", "NONE", True
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    parts = {name.split(".", 1)[1]: pixels for name, pixels in channels(file).items()}
    return {name.removesuffix(".X").removesuffix(".Z"): pixels for name, pixels in parts.items()}


@needs_gpu
def test_nodes_grade_the_range_alone(solved: bpy.types.Scene, tmp_path: Path) -> None:
    found = rendered(solved, tmp_path / "plain.exr")
    plain = np.stack([found[f"Combined.{each}"] for each in "RGB"], axis=2)
    assert bpy.ops.virtual_aperture.add_grade_nodes() == {"FINISHED"}
    ours = solved.view_layers[0].virtual_aperture_passes
    ours.range_far, ours.range_softness = 8.0, 0.0
    solved.view_layers[0].use_pass_z = True
    tree = solved.compositing_node_group
    grade = next(node for node in tree.nodes if node.type == "GROUP")
    grade.inputs["Exposure"].default_value = 1.0
    solved.render.image_settings.media_type = "IMAGE"
    solved.render.image_settings.file_format = "OPEN_EXR"
    solved.render.image_settings.color_depth = "32"
    solved.render.filepath = str(tmp_path / "graded.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(solved.render.filepath)
    graded = np.array(image.pixels).reshape(90, 160, 4)[::-1, :, :3]
    near = np.s_[:, 10:60]
    assert np.allclose(graded[near], 2 * plain[near], rtol=1e-3, atol=1e-4)
    far = np.s_[:, 130:150]
    assert np.allclose(graded[far], plain[far], rtol=1e-3, atol=1e-4)


def test_nodes_of_the_user_stay(solved: bpy.types.Scene) -> None:
    tree = solved.compositing_node_group = bpy.data.node_groups.new("Mine", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    source, out = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(source.outputs["Image"], out.inputs["Image"])
    grade = add_grade_nodes(solved, solved.view_layers[0])
    assert solved.compositing_node_group == tree
    assert [(link.from_node, link.to_node) for link in tree.links if link.to_node == out] == [(source, out)]
    assert not grade.outputs["Image"].is_linked
    # The group is one, however often it is added.
    add_grade_nodes(solved, solved.view_layers[0])
    assert sum(group.name.startswith(NAME) for group in bpy.data.node_groups) == 1


ANIMATION = (
    "import sys; sys.path.insert(0, sys.argv[1]); import bpy, addon; addon.register();"
    "bpy.ops.wm.open_mainfile(filepath=sys.argv[2]); bpy.context.scene.render.filepath = sys.argv[3];"
    "bpy.ops.render.render(animation=True)"
)


@needs_gpu
@pytest.mark.usefixtures("registered")
def test_a_farms_machine_gives_the_matte_of_f12(tmp_path: Path) -> None:
    work = clip.solve(clip.write_video(tmp_path / "clip", 6), tmp_path / "work")
    lens = ("--focus-distance", "7", "--blur", "0.05", "--method", "features", "--views", "4")
    done("farm", work, *lens, "--out", tmp_path / "job")
    blend = tmp_path / "job" / "input" / "scene.blend"
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    ours = scene.view_layers[0].virtual_aperture_passes
    ours.use_range_matte, ours.range_softness = True, 0.5
    ours.range_far = scene.virtual_aperture.focus_distance
    scene.frame_start = scene.frame_end = 3
    scene.frame_set(3)
    here = rendered(scene, tmp_path / "here.exr")
    bpy.ops.wm.save_mainfile()
    words = [sys.executable, "-c", ANIMATION, str(ROOT), str(blend), str(tmp_path / "farm####.exr")]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
    there = channels(tmp_path / "farm0003.exr")
    matte = here[passes.RANGE_MATTE]
    assert 0.01 < matte.mean() < 0.99
    for name, pixels in there.items():
        own = name.split(".", 1)[1].removesuffix(".X").removesuffix(".Z")
        assert np.array_equal(pixels, here[own]), name


def test_nodes_take_a_solve(scene: bpy.types.Scene) -> None:
    with pytest.raises(RuntimeError, match="Solve the clip first"):
        bpy.ops.virtual_aperture.add_grade_nodes()
