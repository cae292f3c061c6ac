"""Leaving people out of a clip's tracks, and solving a clip that they fill."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from addon.core.base.errors import Remedy, UserError
from addon.core.base.worker import Worker, end
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.first_person import nearest_subject
from addon.core.media.clip import FrameRange, open_footage
from addon.core.readers.colmap_export import read_model
from addon.core.sfm import worker
from addon.core.sfm.report import STAYS, Figures, report
from addon.core.sfm.tracking import people_left_out
from addon.core.sfm.tracking.people_left_out import outside, without_people
from addon.core.sfm.tracking.tracks import Tracks
from addon.core.subjects.networks import Networks

from .. import planes
from ..solving import refused, solve
from ..subjects.figures import figure
from ..waiting import until

FRAMES = 16
TOP = 80
"""Row from which on someone stays in place in the pictures of `followed`."""


def tracks(xy: dict[int, list[tuple[float, float]]]) -> Tracks:
    """Tracks in a clip of 100x50 pixels by their places in moving."""
    count = len(next(iter(xy.values())))
    rows = [(frame, track, places[frame]) for frame in range(count) for track, places in sorted(xy.items())]
    frame, track, place = zip(*rows, strict=True)
    return Tracks(
        tuple(range(5, 5 + count)), 100, 50, np.array(frame, np.int32), np.array(track, np.int32),
        np.array(place), np.zeros((max(xy) + 1, 3), np.uint8),
    )  # fmt: skip


def test_tracks_that_are_mostly_on_masks_are_left_out_and_numbers_stay() -> None:
    inside, margin, away = (70.0, 20.0), (49.2, 20.0), (20.0, 20.0)
    given = tracks(
        {0: [away] * 4, 1: [inside] * 4, 2: [inside, inside, inside, away], 3: [margin] * 4,
         4: [inside, away, away, away], 5: [(100.0, 50.0)] * 4, 6: [(0.0, 0.0)] * 4}
    )  # fmt: skip
    # Half the size of the clip: its right half, in moving.
    mask = np.zeros((25, 50), bool)
    mask[:, 25:] = True
    asked = list[int]()

    def of(frame: int) -> np.ndarray:
        asked.append(frame)
        return mask

    left = outside(given, of)
    assert asked == [5, 6, 7, 8]
    assert np.unique(left.track).tolist() == [0, 4, 6]
    assert left.count == given.count and len(left.xy) == 12
    for index in range(4):
        number, places = left.in_frame(index)
        assert number.tolist() == [0, 4, 6] and places[0].tolist() == list(away)


def test_tracks_on_a_person_are_left_out_and_progress_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    clip = open_footage(planes.write_clip(tmp_path / "person", [figure()[..., ::-1]] * 6))
    # On the shirt, and beside the person.
    given = Tracks(
        clip.frames, 320, 240, np.repeat(np.arange(6), 2).astype(np.int32),
        np.tile([0, 1], 6).astype(np.int32),
        np.tile([[160.0, 105.0], [40.0, 60.0]], (6, 1)), np.zeros((2, 3), np.uint8),
    )  # fmt: skip
    steps = list[tuple[str, int, int]]()
    monkeypatch.setattr(people_left_out, "progress", lambda *step: steps.append(step))
    left = without_people(given, clip)
    assert left is not None and np.unique(left.track).tolist() == [1] and len(left.xy) == 6
    assert {stage for stage, _, _ in steps} == {"Looking for people"}
    assert all(0 <= done <= total == 6 for _, done, total in steps)


class Sees(Networks):
    """No people, and a segmenter that sees a thing in the middle, as surely as a probability says."""

    exist = True

    def __init__(self, probability: float) -> None:
        super().__init__()
        self._sure = probability

    @property
    def segmenter(self) -> Any:
        return self

    def probability(self, crop: np.ndarray) -> np.ndarray:
        shares = np.zeros(crop.shape[:2], np.float32)
        cv2.circle(shares, (crop.shape[1] // 2, crop.shape[0] // 2), 80, self._sure, -1)
        return shares

    def poses(self, _picture: np.ndarray, _least: float) -> list[Any]:
        return []


@pytest.mark.parametrize(("probability", "left"), [(0.95, [1]), (0.6, None)])
def test_what_stands_out_for_a_segmenter_is_left_out(
    tmp_path: Path, probability: float, left: list[int] | None
) -> None:
    clip = open_footage(planes.write_clip(tmp_path / "walk", planes.sideways(6)))
    given = Tracks(
        clip.frames, 320, 240, np.repeat(np.arange(6), 2).astype(np.int32),
        np.tile([0, 1], 6).astype(np.int32),
        np.tile([[160.0, 120.0], [20.0, 20.0]], (6, 1)), np.zeros((2, 3), np.uint8),
    )  # fmt: skip
    found = without_people(given, clip, Sees(probability))
    assert (None if found is None else np.unique(found.track).tolist()) == left


@pytest.mark.parametrize(("step", "pan", "alive"), [(0.0, 3.0, False), (1.0, 3.0, True)])
def test_a_figure_that_moves_as_one_with_the_scene_is_no_person(
    tmp_path: Path, step: float, pan: float, alive: bool
) -> None:
    """A mannequin before a camera that pans; someone who moves by a pixel a frame."""
    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    clip = open_footage(planes.write_clip(tmp_path / "person", [figure()[..., ::-1]] * 6))
    rng = np.random.default_rng(3)
    own, rest = rng.uniform((145, 80), (175, 130), (12, 2)), rng.uniform((5, 5), (90, 235), (40, 2))
    xy = [
        np.concatenate([np.add(own, ((pan + step) * frame / 6, 0)), np.add(rest, (pan * frame / 6, 0))])
        for frame in range(6)
    ]
    given = Tracks(
        clip.frames, 320, 240, np.repeat(np.arange(6), 52).astype(np.int32),
        np.tile(np.arange(52), 6).astype(np.int32), np.concatenate(xy) + rng.normal(0, 0.02, (312, 2)),
        np.zeros((52, 3), np.uint8),
    )  # fmt: skip
    assert (without_people(given, clip) is not None) == alive


def followed() -> list[np.ndarray]:
    """A camera that walks past planes beside someone who stays in place in its picture, and fills it."""
    pictures, texture = planes.sideways(FRAMES), planes.pattern(320, 240 - TOP, 9)
    for seed, picture in enumerate(pictures):
        noise = np.random.default_rng(seed).normal(0, 1, texture.shape)
        picture[TOP:] = np.clip(texture + noise, 0, 255).astype(np.uint8)[..., None]
    return pictures


IN_PLACE = f"mask[{TOP}:] = True"
GIVEN = """
import sys
from pathlib import Path
import numpy as np
from addon.core.sfm import worker
from addon.core.sfm.tracking.people_left_out import outside

mask = np.zeros((240, 320), bool)
{}
worker.without_people = lambda tracks, *_: outside(tracks, lambda frame: mask)
worker.main(Path(sys.argv[1]))
"""


def solved_with_mask(clip: Path, folder: Path, people: str = IN_PLACE) -> Figures:
    """The figures of a clip in which people are where code puts them in a mask."""
    folder.mkdir()
    process = Worker()
    process.start([sys.executable, "-c", GIVEN.format(people), str(folder)])
    call = process.call(partial(worker.solve, worker.SolveJob(open_footage(clip)), folder))
    until(lambda: process.poll() is not None and call.ended)
    end([process])
    return call.result()


@pytest.mark.long
def test_a_clip_that_is_refused_is_solved_without_its_people(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "beside", followed())
    assert "the camera does not move" in refused(clip, tmp_path / "work")

    figures = solved_with_mask(clip, tmp_path / "solve")
    assert figures.explained is not None and figures.explained > 0.9
    assert "the clip's subjects were left out of the solve" in figures.notes
    names = [each.name for each in figures.attempts]
    assert {"corners", "no subjects, moving"} <= {*names} and names[-1] == "no subjects, moving"
    assert "does not move" in next(each.refusal for each in figures.attempts if each.name == "corners")
    found = read_model(tmp_path / "solve" / "model")
    assert len(found.images) == FRAMES and found.points.error.mean() < 0.5
    assert all((image.xy[:, 1] < TOP).all() for image in found.images)
    # The camera walks steadily.
    steps = np.linalg.norm(np.diff([image.centre for image in found.images], axis=0), axis=1)
    assert steps.min() > 0.5 * steps.max()


def test_a_clip_without_a_solution_is_refused_and_the_people_named(tmp_path: Path) -> None:
    grey = [np.full((240, 320, 3), 128, np.uint8)] * 6
    with pytest.raises(UserError, match="features") as caught:
        solved_with_mask(planes.write_clip(tmp_path / "grey", grey), tmp_path / "solve")
    assert "the clip's subjects were left out of the solve" in str(caught.value)
    assert caught.value.remedies == (Remedy.FRAMES,)


def test_a_still_camera_is_solved_for_the_people_before_it(tmp_path: Path) -> None:
    clip = planes.write_clip(tmp_path / "still", [planes.view(np.zeros(3), np.zeros(3))] * 6)
    assert "the camera does not move" in refused(clip, tmp_path / "work")

    figures = solved_with_mask(clip, tmp_path / "solve")
    assert figures.method == STAYS and figures.depth_estimated
    found = read_model(tmp_path / "solve" / "model")
    assert found.stays and len(found.images) == 6
    told = report(found, tuple(range(1, 7)), figures)
    assert told.advice.startswith("the background's distance is a guess")
    assert told.remedies == (Remedy.DEPTH_MAPS,)


@pytest.mark.long
def test_warped_pictures_with_little_parallax_are_solved_for_their_people(tmp_path: Path) -> None:
    """No camera explains them; people have distances without parallax, too."""
    rng, corners = np.random.default_rng(5), np.array([[0, 0], [320, 0], [320, 240], [0, 240]], np.float32)
    pictures = []
    for step, picture in enumerate(planes.clip(np.linspace([-0.1, 0, 0], [0.1, 0, 0], FRAMES))):
        bent = corners + rng.uniform(-3, 3, (4, 2)).astype(np.float32)
        warp = cv2.getPerspectiveTransform(corners, bent)
        moved = cv2.warpPerspective(picture, warp, (320, 240), borderMode=cv2.BORDER_REFLECT)
        moved[TOP:, 140:] = np.roll(planes.pattern(180, 240 - TOP, 9), 3 * step, 0)[..., None]
        pictures.append(moved)
    clip = planes.write_clip(tmp_path / "warped", pictures)
    figures = solved_with_mask(clip, tmp_path / "solve", "mask[:, 130:] = True")
    assert figures.method == STAYS and figures.depth_estimated
    assert len(read_model(tmp_path / "solve" / "model").images) == FRAMES


@pytest.mark.long
@pytest.mark.parametrize("name", ["people_two_portrait_1", "people_two_talk_street_1"])
def test_real_clips_of_people_without_parallax_are_solved(data: Path, tmp_path: Path, name: str) -> None:
    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    solved = solve(data / "clips" / f"{name}.mp4", tmp_path / "work", frames=FrameRange(1, 40))
    assert solved.reconstruction.stays and len(solved.reconstruction.images) == 40
    assert solved.quality.explained is not None and solved.quality.explained > 0.8
    context = ClipContext(solved.reconstruction, open_footage(data / "clips" / f"{name}.mp4").read)
    place = nearest_subject(context)
    assert place is not None and place.source == "the nearest person"
    away = np.array([place.followed[frame] for frame in sorted(place.followed)])
    assert away.min() > 1 and away.max() < 5 and np.abs(np.diff(np.log(away))).max() < 0.05


@pytest.mark.long
def test_a_real_clip_of_trees_without_parallax_stays_refused(data: Path, tmp_path: Path) -> None:
    said = refused(data / "clips" / "still_trees_1.mp4", tmp_path / "work")
    assert "the camera only turns in this clip" in said
