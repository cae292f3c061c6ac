"""The focus at a place of the picture: from points that are near, from dense depth, or estimated."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.base.arrays import Floats
from addon.core.base.errors import UserError
from addon.core.depth.source import FirstKnown
from addon.core.focus.place import NEAR, PlaceFinder
from addon.core.focus.pull import inverse_depths
from addon.core.media.clip import open_footage
from addon.core.readers.colmap_export import write_model
from addon.scene.sources.shot import Shot

from .. import planes
from ..planes import HEIGHT, LENS, PLANES, STEPS, WIDTH, clip, features, poses
from ..subjects import walls

CENTRES = np.column_stack([STEPS, 0.1 * STEPS**2, STEPS])
"""To the side, and ahead as far."""
FRAME, PLANE = 5, 6.0
BARE = (0.26, 0.5)
"""A place on the plane without points; the nearest are on the wall behind."""
BESIDE = (0.68, 0.5)


@pytest.fixture(scope="module")
def footage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return planes.write_clip(tmp_path_factory.mktemp("footage") / "walk", clip(CENTRES))


@pytest.fixture(scope="module")
def shot(footage: Path) -> Shot:
    points = features()
    return Shot(open_footage(footage), poses(CENTRES, points[points[:, 2] != PLANE]))


def test_a_place_without_points_has_its_dense_depth(shot: Shot) -> None:
    found = shot.context.places(FRAME).find(*BARE)
    depth = PLANE - CENTRES[FRAME - 1, 2]
    assert found.distance == pytest.approx(depth, rel=0.02)
    assert found.focus.points == () and found.focus.distance == found.distance
    assert "dense depth" in found.source
    # It is followed as a place that stands still.
    frames = range(1, len(CENTRES) + 1)
    distances = 1 / inverse_depths(found, shot.reconstruction, frames)
    assert distances == pytest.approx(PLANE - CENTRES[:, 2], rel=0.02)


def test_a_place_amid_points_on_its_surface_is_theirs(footage: Path) -> None:
    found = Shot(open_footage(footage), poses(CENTRES, near_plane())).context.places(FRAME).find(*BESIDE)
    assert len(found.focus.points) == 4
    assert found.distance == pytest.approx(4.0, rel=1e-6)
    assert found.source.startswith("points ") and "px of the place" in found.source
    assert float(found.source.split("within ")[1].split()[0]) <= NEAR * WIDTH
    assert found.world is None and not found.followed


def test_a_place_amid_points_on_another_surface_is_not_theirs(footage: Path) -> None:
    """Its own surface has no points near; around it those of the wall behind are seen, past its edge."""
    edge = LENS.fx * PLANES[4.0][0] / 4 + LENS.cx
    click = ((edge + 6) / WIDTH, 0.5)
    rng = np.random.default_rng(0)
    xy = np.array([edge, HEIGHT / 2]) + np.column_stack([rng.uniform(-8, -2, 40), rng.uniform(-8, 8, 40)])
    wall = np.column_stack([(xy - [LENS.cx, LENS.cy]) * 10 / LENS.fx, np.full(40, 10.0)])
    xyz = np.concatenate([features()[::3], wall])
    xyz = xyz[(xyz[:, 2] != 4) | (np.abs(xyz[:, 0] - PLANES[4.0][0]) > 0.4)]
    context = Shot(open_footage(footage), poses(CENTRES, xyz)).context
    found = context.places(FRAME).find(*click)
    assert found.distance == pytest.approx(4.0, rel=0.03) and not found.focus.points
    assert "the points around it lie on something else" in found.source


def near_plane() -> Floats:
    """Points on the nearest plane alone."""
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(0.6, 1.5, 80), rng.uniform(-1, 1, 80), np.full(80, 4.0)])


def test_where_depth_is_uncertain_it_is_estimated(tmp_path: Path) -> None:
    plain = [np.full((HEIGHT, WIDTH, 3), 90, np.uint8) for _ in CENTRES]
    footage = open_footage(planes.write_clip(tmp_path / "plain", plain))
    points = features()
    corner = points[(points[:, 2] == 4) & (points[:, 1] < -0.3)]
    finder = Shot(footage, poses(CENTRES, corner)).context.places(FRAME)
    place = finder.find(0.1, 0.9)
    assert place.is_estimated and place.source.endswith(", estimated")
    assert place.distance == pytest.approx(4.0, rel=0.05) and not place.focus.points
    assert finder.glance(0.1, 0.9).distance == pytest.approx(place.distance)


def test_a_frame_without_depth_and_points_is_refused() -> None:
    nothing = FirstKnown(())
    finder = PlaceFinder(poses(CENTRES, features()[:1]), nothing, lambda frame: np.zeros((0, 0, 3)), FRAME)
    with pytest.raises(UserError, match=r"frame 5 shows no depth at 0\.1,0\.9; pick in another frame"):
        finder.find(0.1, 0.9)


def test_the_command_line_says_how_far_and_follows(
    registered: None, shot: Shot, footage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "model").mkdir()
    write_model(tmp_path / "model", shot.reconstruction)
    work = tmp_path / "work"
    assert (
        run_command(["import", str(tmp_path / "model"), "--footage", str(footage), "--work", str(work)]) == 0
    )
    at = f"{BARE[0]},{BARE[1]}@{FRAME}"
    assert run_command(["save", str(work), "--blend", str(tmp_path / "a.blend"), "--focus-at", at]) == 0
    said = capsys.readouterr().out
    assert "in focus: " in said and f" away at frame {FRAME}, from the clip's dense depth" in said
    scene = bpy.context.scene
    distances = []
    for frame in (1, FRAME, len(CENTRES)):
        scene.frame_set(frame)
        distances.append(scene.virtual_aperture.focus_distance)
    true = PLANE - CENTRES[[0, FRAME - 1, -1], 2]
    # Whatever a unit is.
    np.testing.assert_allclose(np.array(distances) / distances[1], true / true[1], rtol=0.01)


def test_the_command_line_focuses_on_the_object_that_is_clicked(
    registered: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    few = tuple(range(11, 22))
    footage = planes.write_clip(
        tmp_path / "walls", [walls.with_disc(frame)[..., ::-1] for frame in few], few[0]
    )
    (tmp_path / "model").mkdir()
    write_model(tmp_path / "model", walls.filmed(walls.with_disc, few).reconstruction)
    words = ["import", str(tmp_path / "model"), "--footage", str(footage), "--work", str(tmp_path / "work")]
    assert run_command(words) == 0
    x, y = walls.place(16)
    at = f"{x / walls.WIDTH},{y / walls.HEIGHT}"
    words = ["save", str(tmp_path / "work"), "--blend", str(tmp_path / "a.blend"), "--focus-at", f"{at}@16"]
    assert run_command(words) == 0
    said = capsys.readouterr().out
    assert "from the subject object 1, seen" in said
    settings = bpy.context.scene.virtual_aperture
    assert not len(settings.subjects.items)
    assert len(settings.marks.items[0].places[0].followed) == len(few)
