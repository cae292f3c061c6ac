"""The sample scene is the same every time, its truth fits its pictures, and the demo measures rightly."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from sample_scenes import clip, demo, desk

from ..solving import solve

CLIP = Path(desk.__file__).with_name("desk.mp4")


@pytest.fixture(scope="module")
def scene() -> bpy.types.Scene:
    return desk.build(64, 36, frames=desk.FRAMES, samples=2, denoise=False)


def test_tiny_render_is_neither_black_nor_clipped(scene: bpy.types.Scene, tmp_path: Path) -> None:
    first, last = tmp_path / "first.png", tmp_path / "last.png"
    desk.render_frame(scene, 1, first)
    desk.render_frame(scene, desk.FRAMES, last)
    picture = cv2.imread(str(first))
    assert picture.shape == (36, 64, 3)
    assert 60 < picture.mean() < 180
    assert (picture == 255).all(axis=-1).mean() < 0.05
    assert np.abs(picture.astype(int) - cv2.imread(str(last))).mean() > 5, "the camera stands still"


def test_truth_is_what_blender_films(scene: bpy.types.Scene) -> None:
    known = desk.truth(64, 36)
    for frame in (1, 20, desk.FRAMES):
        scene.frame_set(frame)
        pose = np.array(scene.camera.matrix_world)
        np.testing.assert_allclose(pose[:3, 3], known.centres[frame - 1], atol=1e-6)
        axes = known.rotation[frame - 1].T * (1, -1, -1)
        np.testing.assert_allclose(pose[:3, :3], axes, atol=1e-5)
    # And through Blender's own projection, which knows nothing of our axes.
    from bpy_extras.object_utils import world_to_camera_view
    from mathutils import Vector

    u, v, depth = world_to_camera_view(scene, scene.camera, Vector(desk.SUBJECT))
    np.testing.assert_allclose(known.project(desk.SUBJECT[None])[-1, 0], (u * 64, 36 - v * 36), atol=1e-3)
    assert depth == pytest.approx(known.subject_depth[-1], abs=1e-5)


def test_committed_clip_is_whole() -> None:
    capture = cv2.VideoCapture(str(CLIP))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(desk.FPS)
    capture.release()
    assert demo.read_clip(CLIP).shape == (desk.FRAMES, desk.HEIGHT, desk.WIDTH, 3)
    assert CLIP.stat().st_size <= 1_500_000
    sound = bpy.data.sounds.load(str(CLIP))
    assert sound.samplerate == clip.RATE
    assert sound.channels == "MONO"
    bpy.data.sounds.remove(sound)


def test_the_committed_clip_is_solved_whole(tmp_path: Path) -> None:
    assert "36 of 36 frames registered" in solve(CLIP, tmp_path / "work").summary


def _blurred_copy(out: Path, count: int, tmp_path: Path) -> None:
    """A clip as a lens focused on the subject would leave it: all blurred but the globe's box."""
    names = []
    for index, frame in enumerate(demo.read_clip(CLIP)[:count]):
        soft = cv2.GaussianBlur(frame, (0, 0), 4)
        x0, y0, x1, y1 = (np.array(demo.subject_box(index)) * (640, 360, 640, 360)).round().astype(int)
        soft[y0 - 4 : y1 + 4, x0 - 4 : x1 + 4] = frame[y0 - 4 : y1 + 4, x0 - 4 : x1 + 4]
        names.append(tmp_path / f"soft{index:04d}.png")
        cv2.imwrite(str(names[-1]), soft)
    clip.encode(names, out, desk.FPS)


def test_demo_shows_and_measures_a_result(tmp_path: Path) -> None:
    result = tmp_path / "result.mp4"
    _blurred_copy(result, desk.FRAMES, tmp_path)
    shown = demo.show(CLIP, result, tmp_path / "demo")
    assert 0.85 < shown.subject < 1.1
    assert shown.background < 0.05
    assert demo.read_clip(shown.clip).shape == (desk.FRAMES, desk.HEIGHT, 2 * desk.WIDTH, 3)
    assert cv2.imread(str(shown.still)).shape == (desk.HEIGHT, 2 * desk.WIDTH, 3)


def test_demo_says_what_is_wrong(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    short = tmp_path / "short.mp4"
    _blurred_copy(short, 3, tmp_path)
    with pytest.raises(demo.DemoError, match="36 frames of 640x360 and 3 frames"):
        demo.show(CLIP, short, tmp_path)
    monkeypatch.setattr("sys.argv", ["demo.py", "--out-dir", str(tmp_path)])
    monkeypatch.setattr(demo, "ROOT", tmp_path)  # where there is no command line
    assert demo.main() == 1
    assert "status 2" in capsys.readouterr().err
