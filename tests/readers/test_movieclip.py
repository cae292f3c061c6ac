"""Blender's own solves come in as they are: poses, lens, pixels, frames, and Blender's own errors."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Reconstruction, rotation_matrix
from addon.core.media.clip import Footage, FrameRange, open_footage
from addon.core.readers.matching import ONLY_TURNS
from addon.scene.sources.movieclip import read_movie_clip

WIDTH, HEIGHT, FOCAL = 320, 180, 300.0
FRAMES = 10
FIRST = 5
"""Number of the first file."""


@dataclass(frozen=True)
class Lens:
    """Distortion as Blender's properties have it, and what libmv makes of it."""

    model: str = "POLYNOMIAL"
    terms: dict[str, float] = field(default_factory=dict)
    aspect: float = 1.0
    middle: tuple[float, float] = (166.0, 83.0)
    """The principal point in pixels from the lower left corner."""

    def distort(self, rays: np.ndarray) -> np.ndarray:
        """(n, 2) rays, y up -> where they are seen. Formulas of libmv's distortion_models.h."""
        x, y = rays.T
        q = x * x + y * y
        k = [self.terms.get(f"{self.model.lower()}_k{i}", self.terms.get(f"k{i}", 0.0)) for i in range(1, 5)]
        p1, p2 = (self.terms.get(f"{self.model.lower()}_p{i}", 0.0) for i in (1, 2))
        if self.model == "DIVISION":
            return rays / (1 + k[0] * q + k[1] * q**2)[:, None]
        if self.model == "NUKE":
            half = max(WIDTH, int(HEIGHT / self.aspect)) / 2 / FOCAL
            seen = rays
            # Far outside the picture this ends nowhere.
            with np.errstate(over="ignore", invalid="ignore"):
                for _ in range(200):
                    u, v = (seen / half).T ** 2
                    r = u + v
                    both = 1 + k[0] * r + k[1] * r * r
                    seen = rays * np.stack([both + p1 * v, both + p2 * u], axis=1)
            return seen
        factor = 1 + k[0] * q + k[1] * q**2 + k[2] * q**3 + k[3] * q**4
        tangential = [p1 * (q + 2 * x * x) + 2 * p2 * x * y, p2 * (q + 2 * y * y) + 2 * p1 * x * y]
        return rays * factor[:, None] + np.transpose(tangential)

    def project(self, local: np.ndarray) -> np.ndarray:
        """Camera space (n, 3), y down, -> shares of the picture (n, 2), y up."""
        seen = self.distort(local[:, :2] / local[:, 2:] * [1, -1])
        return (seen * FOCAL * [1, self.aspect] + self.middle) / [WIDTH, HEIGHT]


@dataclass(frozen=True)
class Shot:
    """A tracked clip and what is true of it."""

    clip: bpy.types.MovieClip
    footage: Footage
    points: np.ndarray
    rotations: np.ndarray
    centres: np.ndarray

    @property
    def target(self) -> bpy.types.MovieTrackingObject:
        return self.clip.tracking.objects[0]


@pytest.fixture(autouse=True)
def empty() -> Iterator[None]:
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    yield
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sequence whose pictures tell their number by their brightness."""
    folder = tmp_path_factory.mktemp("pictures")
    for number in range(FIRST, FIRST + FRAMES + 4):
        cv2.imwrite(
            str(folder / f"shot_{number:04d}.png"), np.full((HEIGHT, WIDTH, 3), 10 * number, np.uint8)
        )
    return folder


def track(folder: Path, lens: Lens = Lens(), noise: float = 0.0, path: Path | None = None) -> Shot:
    """A clip whose tracks were placed where its points are seen, noise in pixels."""
    rng = np.random.default_rng(1)
    points = rng.uniform([-3, -2, 5], [3, 2, 12], (70, 3))
    turns = np.array([rotation_matrix(np.array([0.01, -0.02, 0.005]) * i) for i in range(FRAMES)])
    centres = np.array([[0.25 * i, 0.03 * np.sin(i), 0.05 * i] for i in range(FRAMES)])
    clip = bpy.data.movieclips.load(str(path or folder / f"shot_{FIRST:04d}.png"))
    camera = clip.tracking.camera
    camera.units, camera.focal_length_pixels, camera.pixel_aspect = "PIXELS", FOCAL, lens.aspect
    camera.principal_point_pixels = lens.middle
    camera.distortion_model = lens.model
    for name, value in lens.terms.items():
        setattr(camera, name, value)
    target = clip.tracking.objects[0]
    for _ in points:
        target.tracks.new(frame=1)
    for number, (turn, centre) in enumerate(zip(turns, centres, strict=True), start=1):
        places = lens.project((points - centre) @ turn.T)
        places += noise * rng.standard_normal(places.shape) / [WIDTH, HEIGHT]
        for one, place in zip(target.tracks, places, strict=True):
            marker = one.markers.insert_frame(number, co=place)
            marker.mute = not np.all((place > 0) & (place < 1))
    return Shot(clip, open_footage(path or folder), points, turns, centres)


def solve(shot: Shot) -> None:
    """As Solve Camera Motion does, with the lens held."""
    settings, area = shot.clip.tracking.settings, bpy.context.screen.areas[0]
    settings.use_keyframe_selection = False
    shot.target.keyframe_a, shot.target.keyframe_b = 1, FRAMES
    area.type = "CLIP_EDITOR"
    area.spaces.active.clip = shot.clip
    window = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(area=area, region=window, space_data=area.spaces.active):
        assert bpy.ops.clip.solve_camera() == {"FINISHED"}


def solved(folder: Path, lens: Lens = Lens(), noise: float = 0.0, path: Path | None = None) -> Shot:
    shot = track(folder, lens, noise, path)
    solve(shot)
    return shot


def errors(reconstruction: Reconstruction) -> list[np.ndarray]:
    """Distances between points and their observations by image, in widths of a pixel as Blender counts."""
    xyz, camera = reconstruction.points.xyz, reconstruction.cameras[0]
    return [
        np.linalg.norm(
            (camera.project(i.to_camera(xyz[i.points])) - i.xy) * [1, camera.fx / camera.fy], axis=1
        )
        for i in reconstruction.images
    ]  # fmt: skip


def similarity(source: np.ndarray, target: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Scale, rotation, shift that take points (n, 3) to others best (Umeyama 1991)."""
    one, other = source - source.mean(axis=0), target - target.mean(axis=0)
    left, values, right = np.linalg.svd(other.T @ one)
    flip = np.diag([1, 1, np.linalg.det(left @ right)])
    rotation = left @ flip @ right
    scale = np.trace(np.diag(values) @ flip) / (one**2).sum()
    return scale, rotation, target.mean(axis=0) - scale * rotation @ source.mean(axis=0)


LENSES = [
    Lens(),
    Lens("POLYNOMIAL", {"k1": -0.12, "k2": 0.05, "k3": -0.02}),
    Lens("DIVISION", {"division_k1": 0.15, "division_k2": 0.02}, aspect=0.9),
    Lens("NUKE", {"nuke_k1": -0.1, "nuke_k2": 0.03}, aspect=1.5),
    Lens("BROWN", {"brown_k1": 0.1, "brown_k4": 0.1, "brown_p1": -0.004, "brown_p2": 0.01}, aspect=1.2),
]


@pytest.mark.parametrize("lens", LENSES, ids=lambda lens: f"{lens.model}-{len(lens.terms)}-{lens.aspect}")
def test_exact_markers_give_back_poses_points_and_lens(pictures: Path, lens: Lens) -> None:
    shot = solved(pictures, lens)
    imported = read_movie_clip(shot.clip, shot.footage)
    found = imported.reconstruction
    assert list(found.frames) == list(range(FIRST, FIRST + FRAMES))
    assert not any("lens" in note for note in imported.notes)
    # Blender's solver itself ends at about 1e-5 pixels; a lens that is fitted may add 1e-2.
    worst = max(e.max() for e in errors(found))
    exact = lens.model != "NUKE" and "brown_k4" not in lens.terms
    print(f"{lens.model}: {worst:.2g} px, Blender {shot.target.reconstruction.average_error:.2g} px")
    assert worst < (1e-3 if exact else 0.01)
    centres = np.array([image.centre for image in found.images])
    scale, rotation, shift = similarity(centres, shot.centres)
    assert np.abs(scale * centres @ rotation.T + shift - shot.centres).max() < 2e-4
    turns = np.array([image.rotation @ rotation.T for image in found.images])
    assert np.abs(turns - shot.rotations).max() < 2e-4
    moved = scale * found.points.xyz @ rotation.T + shift
    known = [one.has_bundle for one in shot.target.tracks]
    assert np.abs(moved - shot.points[known]).max() < 5e-3
    np.testing.assert_allclose(found.cameras[0].focal, [FOCAL, FOCAL * lens.aspect], rtol=1e-6)
    np.testing.assert_allclose(
        found.cameras[0].principal_point, [lens.middle[0], HEIGHT - lens.middle[1]], atol=1e-4
    )


@pytest.mark.parametrize("aspect", [1.0, 1.3], ids=["square", "138.46 rows"])
def test_errors_are_blenders_own(pictures: Path, aspect: float) -> None:
    shot = solved(pictures, Lens("BROWN", {"brown_k1": -0.1, "brown_p1": 0.01}, aspect), noise=0.4)
    found = read_movie_clip(shot.clip, shot.footage).reconstruction
    theirs = shot.target.reconstruction
    by_image = errors(found)
    seen = np.concatenate([image.points for image in found.images])
    by_track = np.bincount(seen, np.concatenate(by_image)) / np.bincount(seen)
    their_tracks = [one.average_error for one in shot.target.tracks if one.has_bundle]
    their_cameras = [camera.average_error for camera in theirs.cameras]
    off = (
        np.abs(by_track - their_tracks).max(),
        np.abs([e.mean() for e in by_image] - np.array(their_cameras)).max(),
    )
    print(f"average {theirs.average_error:.6f}, off by track {off[0]:.2g}, by camera {off[1]:.2g} px")
    assert 0.1 < theirs.average_error < 1
    assert max(off) < 1e-4
    assert abs(np.concatenate(by_image).mean() - theirs.average_error) < 1e-4
    if aspect == 1:
        np.testing.assert_allclose(found.points.error, their_tracks, atol=1e-4)


@pytest.mark.parametrize(("aspect", "up"), [(1.0, 83.0), (1.25, 90.0)])
def test_pixels_are_those_of_the_camera_that_blender_makes(pictures: Path, aspect: float, up: float) -> None:
    # With both non-square pixels and a principal point off the middle row Blender's camera misses its own
    # solve by the difference of (1 - aspect) * (90 - up) pixels.
    shot = solved(pictures, Lens(aspect=aspect, middle=(166.0, up)))
    shot.clip.frame_start = 31
    area = bpy.context.screen.areas[0]
    with bpy.context.temp_override(area=area, space_data=area.spaces.active):
        assert bpy.ops.clip.setup_tracking_scene() == {"FINISHED"}
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.pixel_aspect_x = aspect
    # Blender lays the solve into the camera's own, freely chosen place.
    place = scene.camera.matrix_basis.copy()
    found = read_movie_clip(shot.clip, shot.footage).reconstruction
    worst = 0.0
    for image in found.images:
        scene.frame_set(31 + image.frame - FIRST)
        for point, xy in zip(found.points.xyz[image.points], image.xy, strict=True):
            x, y, _ = world_to_camera_view(scene, scene.camera, place @ Vector(point))
            worst = max(worst, float(np.hypot(x * WIDTH - xy[0], (1 - y) * HEIGHT - xy[1])))
    print(f"world_to_camera_view: {worst:.2g} px")
    assert worst < 1e-3


def shown(clip: bpy.types.MovieClip, frame: int, folder: Path) -> int:
    """Number of the picture that Blender shows of a clip at a frame of the scene."""
    scene = bpy.context.scene
    tree = bpy.data.node_groups.new("shown", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    source, out = tree.nodes.new("CompositorNodeMovieClip"), tree.nodes.new("NodeGroupOutput")
    source.clip = clip
    tree.links.new(source.outputs["Image"], out.inputs["Image"])
    scene.compositing_node_group = tree
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(scene.camera)
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = 16, 9
    scene.render.filepath = str(folder / "shown.png")
    scene.frame_set(frame)
    bpy.ops.render.render(write_still=True)
    return round(float(cv2.imread(scene.render.filepath)[4, 8, 0]) / 10)


def test_frames_are_those_that_blender_shows(pictures: Path, tmp_path: Path) -> None:
    offset, shot = 3, solved(pictures)
    shot.clip.frame_start, shot.clip.frame_offset = 40, offset
    found = read_movie_clip(shot.clip, shot.footage).reconstruction
    assert found.frames[0] == shown(shot.clip, 40, tmp_path)
    assert list(found.frames) == list(range(FIRST + offset, FIRST + offset + FRAMES))


def test_a_video_counts_from_one(pictures: Path, tmp_path: Path) -> None:
    path = tmp_path / "shot.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 24, (WIDTH, HEIGHT))
    for number in range(FRAMES + 4):
        writer.write(np.full((HEIGHT, WIDTH, 3), 10 * (number + 1), np.uint8))
    writer.release()
    shot = solved(pictures, path=path)
    assert shot.footage.is_video
    shot.clip.frame_start = -7
    for offset in (0, 3):
        shot.clip.frame_offset = offset
        found = read_movie_clip(shot.clip, shot.footage).reconstruction
        assert list(found.frames) == list(range(1 + offset, 1 + offset + FRAMES))
        assert found.frames[0] == shown(shot.clip, -7, tmp_path)
    # The same clip as pictures of another number: only their order tells.
    shot.clip.frame_offset = 0
    imported = read_movie_clip(shot.clip, open_footage(pictures))
    assert list(imported.reconstruction.frames) == list(range(FIRST, FIRST + FRAMES))
    assert any("in order" in note for note in imported.notes)
    with pytest.raises(UserError, match=f"has {FRAMES + 4} frames and the chosen clip .* 6;"):
        read_movie_clip(shot.clip, open_footage(pictures, FrameRange(5, 10)))


def test_what_is_not_in_the_footage_is_left_out_with_a_note(pictures: Path) -> None:
    shot = solved(pictures)
    imported = read_movie_clip(shot.clip, open_footage(pictures, FrameRange(7, 30, 2)))
    assert list(imported.reconstruction.frames) == [7, 9, 11, 13]
    assert "6 solved frames are not in the chosen clip" in imported.notes
    assert "2 frames of the chosen clip are not solved" in imported.notes
    assert all(len(image.points) for image in imported.reconstruction.images)
    assert max(e.max() for e in errors(imported.reconstruction)) < 1e-3
    with pytest.raises(UserError, match=r"shares no solved frames .* has frames 15 to 18"):
        read_movie_clip(shot.clip, open_footage(pictures, FrameRange(15, 30)))


def test_muted_markers_unplaced_tracks_and_objects_are_left_out(pictures: Path) -> None:
    shot = track(pictures)
    tracks = shot.target.tracks
    for marker in tracks[3].markers:
        marker.mute = True
    moved = tracks[5].markers[4]
    moved.co, moved.mute = (0.9, 0.9), True
    # The pattern that is followed lies beside the point that is meant.
    tracks[7].offset = (0.1, -0.2)
    for marker in tracks[7].markers:
        marker.co = np.array(marker.co) - np.array(tracks[7].offset)
    solve(shot)
    shot.clip.tracking.objects.new("Spoon").tracks.new(frame=1)
    imported = read_movie_clip(shot.clip, shot.footage)
    assert "object tracks are ignored: Spoon" in imported.notes
    assert "1 of 70 tracks without a 3D position left out" in imported.notes
    assert len(imported.reconstruction.points) == 69
    assert max(e.max() for e in errors(imported.reconstruction)) < 1e-3
    # Row 3 has gone, so the muted marker's point is row 4.
    assert 4 not in imported.reconstruction.images[4].points
    assert 4 in imported.reconstruction.images[3].points


@pytest.mark.parametrize(("aspect", "width"), [(1.25, WIDTH * 5 // 8), (1.25, WIDTH // 2)])
def test_a_clip_of_another_size_is_scaled(pictures: Path, aspect: float, width: int) -> None:
    """Half its size; with the pixels made square, as a video's header asks for, and as they are stored."""
    shot = solved(pictures, Lens("DIVISION", {"division_k1": 0.1}, aspect))
    whole = read_movie_clip(shot.clip, shot.footage).reconstruction
    footage = replace(shot.footage, width=width, height=HEIGHT // 2)
    imported = read_movie_clip(shot.clip, footage)
    half, camera = imported.reconstruction, imported.reconstruction.cameras[0]
    assert (camera.width, camera.height) == (width, HEIGHT // 2)
    assert camera.fy / camera.fx == pytest.approx(aspect * (WIDTH // 2) / width, rel=1e-6)
    for one, other in zip(whole.images, half.images, strict=True):
        np.testing.assert_allclose(one.xy * [width / WIDTH, 0.5], other.xy)
    assert max(e.max() for e in errors(half)) < 1e-3
    assert "320x180 and is scaled to" in " ".join(imported.notes)


def test_a_lens_that_no_model_of_ours_is_says_by_how_much(pictures: Path) -> None:
    terms = {"nuke_k1": 0.02, "nuke_p1": 0.002, "nuke_p2": -0.001}
    shot = solved(pictures, Lens("NUKE", terms))
    imported = read_movie_clip(shot.clip, shot.footage)
    (note,) = [note for note in imported.notes if "lens" in note]
    claimed = float(note.split()[-2])
    worst = max(e.max() for e in errors(imported.reconstruction))
    print(f"{note}; worst of the points {worst:.3f} px")
    assert 0.01 < worst < claimed + 1e-3
    shot.clip.tracking.camera.nuke_p1 = 0.2
    with pytest.raises(UserError, match="can only be matched to within"):
        read_movie_clip(shot.clip, shot.footage)


def test_refusals_say_what_to_do(pictures: Path) -> None:
    shot = track(pictures)
    with pytest.raises(UserError, match=r"is not solved; .* in the Movie Clip Editor first"):
        read_movie_clip(shot.clip, shot.footage)
    solve(shot)
    with pytest.raises(UserError, match="is 320x180, the chosen clip pictures0 is 320x200; choose the file"):
        read_movie_clip(shot.clip, replace(shot.footage, height=200))
    shot.clip.tracking.camera.pixel_aspect = 1000
    with pytest.raises(UserError, match="has a pixel aspect of 1000,"):
        read_movie_clip(shot.clip, shot.footage)


def test_a_tripod_shot_says_that_it_has_no_depth(pictures: Path) -> None:
    shot = track(pictures)
    shot.clip.tracking.settings.use_tripod_solver = True
    solve(shot)
    assert ONLY_TURNS in read_movie_clip(shot.clip, shot.footage).notes
