"""Cameras without points from file to picture: the same as from a model with points, whatever the source."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest
from mathutils import Matrix

from addon.core.camera.reconstruction import NO_POINTS, Image, Points, Reconstruction
from addon.core.media.clip import open_footage
from addon.core.readers import read_reconstruction
from addon.core.readers.colmap_export import write_model
from addon.core.sfm.workspace import load_solve

from .. import camera_files as files
from .. import planes
from ..command_line import done, here
from ..scenes import psnr

FOCUS, RADIUS = 6.0, 0.15
"""In the unit of the planes."""
FRAME = 6


@dataclass(frozen=True)
class Shot:
    """The clip, and what is wanted of it."""

    clip: Path
    known: Reconstruction
    truth: np.ndarray
    """(h, w) what a lens shows of the planes, linear."""
    score: float
    """PSNR in dB of the picture that the model with points gives."""


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory, registered: None) -> Shot:
    folder = tmp_path_factory.mktemp("cameras")
    clip, known = files.write_clip(folder / "shot"), files.model()
    path = files.colmap(folder / "model", seen(known))
    done("import", path, "--footage", clip, "--work", folder / "work")
    there = truth(known.images[FRAME - 1])
    return Shot(clip, known, there, psnr(rendered(folder / "work"), there))


def seen(known: Reconstruction) -> Reconstruction:
    """The cameras, and points on the planes that they observe."""
    xyz = planes.features()
    images = []
    for image in known.images:
        place = known.intrinsics(image).project(image.to_camera(xyz))
        rows = np.flatnonzero(np.all((place > 0) & (place < planes.SIZE), axis=1)).astype(np.int32)
        images.append(replace(image, xy=place[rows], points=rows))
    points = Points(xyz, np.full((len(xyz), 3), 128, np.uint8), np.zeros(len(xyz)))
    return replace(known, images=tuple(images), points=points)


def truth(image: Image) -> np.ndarray:
    """What a lens of `RADIUS` shows: the mean of views from all over it, each shifted to fit at `FOCUS`."""
    steps = (np.arange(9) - 4) / 4.5
    total, turn = [], cv2.Rodrigues(image.rotation)[0].ravel()
    for across in steps:
        for down in steps:
            if across**2 + down**2 <= 1:
                move = RADIUS * np.array([across, down, 0.0])
                shift = files.SHIFT + planes.FOCAL / FOCUS * move[:2]
                view = planes.view(image.centre + image.rotation.T @ move, turn, shift=tuple(shift))
                total.append((view[..., 0] / 255.0) ** 2.2)
    return np.asarray(np.mean(total, axis=0) ** (1 / 2.2))


def rendered(work: Path, frame: int = FRAME) -> np.ndarray:
    """(h, w) a frame through the lens."""
    out = work.with_suffix(".out")
    done(
        "render", work, "--focus-distance", FOCUS, "--aperture-radius", RADIUS, "--views", 32,
        "--quality", "draft", "--highlights", "off", "--frames", frame, "--out", out / "####.png",
    )  # fmt: skip
    picture = cv2.imread(str(out / f"{frame:04d}.png"), cv2.IMREAD_GRAYSCALE)
    return np.asarray(picture / 255.0)


def blend(path: Path, known: Reconstruction, **changes: object) -> Path:
    """A .blend with a camera named Filmed that is animated as the known ones are."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = planes.SIZE
    scene.frame_start, scene.frame_end = 1, files.COUNT
    data = bpy.data.cameras.new("Filmed")
    thing = bpy.data.objects.new("Filmed", data)
    scene.collection.objects.link(thing)
    lens = known.cameras[0]
    data.lens = lens.fx * data.sensor_width / lens.width
    data.shift_x = (lens.width / 2 - lens.cx) / lens.width
    data.shift_y = (lens.cy - lens.height / 2) / lens.width
    for image, matrix in zip(known.images, files.to_world(known, files.OPENGL), strict=True):
        thing.matrix_world = Matrix(matrix.tolist())
        thing.keyframe_insert("location", frame=image.frame)
        thing.keyframe_insert("rotation_euler", frame=image.frame)
    for name, value in changes.items():
        setattr(scene.render, name, value)
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def check(shot: Shot, work: Path, *words: object, frame: int = FRAME) -> None:
    """Import, with an error that was measured, and render about as well as the model with points gives.

    Exact points give 41.4 dB, tracked ones 40.6: their range of depth is wider, and its levels are coarser.
    """
    said = done("import", *words, "--work", work)
    quality = load_solve(work).quality
    assert f"{quality.registered} of {files.COUNT} frames registered" in said
    assert quality.registered == files.COUNT
    assert quality.reprojection_error is not None and 0.02 < quality.reprojection_error < 0.3
    score = psnr(rendered(work, frame), shot.truth)
    print(f"\n{words[0]}: {score:.2f} dB, with points {shot.score:.2f} dB")
    assert score > 40


def test_cameras_without_points(shot: Shot, tmp_path: Path) -> None:
    """What other formats tell is the same: tests/readers/test_cameras_alone.py."""
    path = files.transforms(tmp_path / "transforms.json", shot.known)
    check(shot, tmp_path / "work", path, "--footage", shot.clip)


@pytest.mark.long
def test_a_camera_of_a_blend(shot: Shot, tmp_path: Path) -> None:
    path = blend(tmp_path / "scene.blend", shot.known)
    check(shot, tmp_path / "work", "--blend", path, "--camera", "Filmed", "--footage", shot.clip)


@pytest.mark.long
def test_a_recording_of_stray_scanner(shot: Shot, tmp_path: Path) -> None:
    check(shot, tmp_path / "work", files.stray(tmp_path / "recording", shot.known, shot.clip))


@pytest.mark.long
def test_a_recording_of_record3d(shot: Shot, tmp_path: Path) -> None:
    """Its pictures begin at 0, and are JPEGs."""
    path = files.record3d(tmp_path / "walk.r3d", shot.known, shot.clip)
    check(shot, tmp_path / "work", path, frame=FRAME - 1)


def depth_cloud(known: Reconstruction, count: int) -> Reconstruction:
    """What a network unprojects from its depth: `count` points a frame that no other sees, all at 10."""
    images, xyz = [], []
    random = np.random.default_rng(7)
    for number, image in enumerate(known.images):
        lens = known.intrinsics(image)
        place = random.uniform([0, 0], planes.SIZE, (count, 2))
        world = (
            np.column_stack([(place - lens.principal_point) / lens.focal, np.ones(count)]) @ image.rotation
        )
        xyz.append(image.centre + world * ((10 - image.centre[2]) / world[:, 2])[:, None])
        rows = np.arange(number * count, (number + 1) * count, dtype=np.int32)
        images.append(replace(image, xy=place, points=rows))
    points = np.concatenate(xyz)
    grey = np.full((len(points), 3), 128, np.uint8)
    return replace(known, images=tuple(images), points=Points(points, grey, np.zeros(len(points))))


def test_points_that_one_frame_sees_are_not_believed(shot: Shot, tmp_path: Path) -> None:
    """They lie on no plane but the farthest, and their error is not 0.00 px: nobody measured one."""
    path = files.colmap(tmp_path / "model", depth_cloud(shot.known, 2000))
    said = done("import", path, "--footage", shot.clip, "--work", tmp_path / "work")
    assert "0.00 px" not in said
    kept = load_solve(tmp_path / "work")
    assert kept.quality.reprojection_error is not None and kept.quality.reprojection_error > 0.02
    low, _, high = kept.quality.distances
    assert low == pytest.approx(4, rel=0.15) and high == pytest.approx(10, rel=0.1)


def test_of_a_camera_that_stays_the_points_are_taken(tmp_path: Path, registered: None) -> None:
    """It tells no depth, the file does: focus works, and no error is said."""
    still = replace(
        files.model(),
        images=tuple(replace(files.model().images[0], frame=number) for number in range(1, files.COUNT + 1)),
    )
    first = files.model().images[0]
    turn = cv2.Rodrigues(first.rotation)[0].ravel()
    picture = planes.view(first.centre, turn, shift=files.SHIFT)
    clip = planes.write_clip(tmp_path / "still", [picture] * files.COUNT)
    path = files.colmap(tmp_path / "model", depth_cloud(still, 500))
    said = done("import", path, "--footage", clip, "--work", tmp_path / "work")
    assert "reprojection error not measured" in said
    assert "how well they fit the clip is unknown" in said
    kept = load_solve(tmp_path / "work")
    assert kept.quality.registered == files.COUNT
    assert min(kept.quality.points_per_frame) > 100
    assert kept.quality.distances[1] == pytest.approx(10.5, rel=0.05)


def test_an_offset_is_a_blender_cameras(tmp_path: Path, shot: Shot) -> None:
    path = files.transforms(tmp_path / "transforms.json", shot.known)
    ended = here("import", path, "--footage", shot.clip, "--work", tmp_path / "work", "--offset", 3)
    assert ended.returncode == 2 and "--offset needs --camera" in ended.stderr
    blended = blend(tmp_path / "scene.blend", shot.known)
    words = ("--footage", shot.clip, "--work", tmp_path / "work")
    ended = here("import", blended, "--camera", "Another", *words)
    assert ended.returncode == 1 and "has no camera 'Another' (it has: Filmed)" in ended.stderr
    ended = here("import", blended, "--camera", "Filmed", "--offset", 2, *words)
    assert ended.returncode == 1 and "(offset -2: " in ended.stderr
    assert not (tmp_path / "work").exists()


def test_cameras_of_every_second_frame(tmp_path: Path, shot: Shot) -> None:
    half = replace(shot.known, images=shot.known.images[::2])
    numbered = tuple(f"frame_{number:05d}.png" for number in range(1, 7))
    path = files.transforms(tmp_path / "transforms.json", half, numbered)
    words = ("import", path, "--footage", shot.clip, "--work", tmp_path / "work")
    ended = here(*words)
    assert ended.returncode == 1
    assert "of every 2nd frame, import them for frames 1-12:2 alone (--frames A-B:STEP)" in ended.stderr
    done(*words, "--frames", "1-12:2")
    kept = load_solve(tmp_path / "work")
    assert kept.frames == (1, 3, 5, 7, 9, 11) and not kept.quality.missing
    # Of the whole clip, those between are the neighbours'.
    named = files.transforms(tmp_path / "named.json", half, files.NAMES[::2])
    said = done("import", named, "--footage", shot.clip, "--work", tmp_path / "all")
    assert "advice: only every 2nd frame from 1 to 11 has a camera" in said
    assert "or these frames alone (--frames A-B:STEP)" in said


def test_photos_that_are_no_clip(data: Path, tmp_path: Path, registered: None) -> None:
    """Cameras that Bundler found for photos from wide apart, without its points: a solve would see cuts."""
    footage = open_footage(data / "kermit")
    known = read_reconstruction(data / "kermit" / "bundle.out", footage).reconstruction
    (tmp_path / "model").mkdir()
    names = {frame: footage.file(frame).name for frame in known.frames.tolist()}
    bare = tuple(Image(i.frame, i.rotation, i.translation, camera=i.camera) for i in known.images)
    write_model(tmp_path / "model", Reconstruction(known.cameras, bare, NO_POINTS), names)
    done("import", tmp_path / "model", "--footage", data / "kermit", "--work", tmp_path / "work")
    kept = load_solve(tmp_path / "work")
    assert kept.reconstruction.frames.tolist() == known.frames.tolist()
    assert len(kept.reconstruction.points) > 50
    assert kept.quality.reprojection_error is not None and kept.quality.reprojection_error < 0.5
    # As far as Bundler's own points, in its own unit.
    theirs = np.median([known.median_depth(image) for image in known.images])
    assert kept.quality.distances[1] == pytest.approx(theirs, rel=0.2)
