"""The nearest person, who is in focus before anybody has picked anything."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.arrays import Bytes, Mask
from addon.core.base.errors import UserError
from addon.core.base.store import Store
from addon.core.focus.focus import Focus
from addon.core.focus.place import Place
from addon.core.frame.first_person import nearest_subject
from addon.core.frame.moving_parts import MovingParts
from addon.core.frame.nearest_person import TURN, _Cast, _nearest, _weights, directed, nearest_person
from addon.core.media.clip import open_footage
from addon.core.subjects.clip_subjects import PEOPLE, ClipSubject, ClipSubjects
from addon.core.subjects.cut import Cut
from addon.core.subjects.networks import Detection, Networks
from addon.core.subjects.people import face_of, people
from addon.core.subjects.pictures import displayed, small
from addon.core.subjects.strokes import MarkedSubject, Stroke, down, nearest_to

from . import walls
from .walls import HEIGHT, WIDTH

NONE = Networks(Path("none"))
NAMES = {"far": 7.0, "near": 3.0, "late": 1.0}
"""People, and how far away they are."""


def standing(name: str, frame: int) -> Mask:
    """(h, w) where a person is: nobody in the first frame, and `late` from frame 5 on."""
    mask = np.zeros((HEIGHT, WIDTH), bool)
    if frame >= (5 if name == "late" else 2):
        left = 40 * (1 + list(NAMES).index(name))
        mask[40:120, left : left + 20] = True
    return mask


@dataclass(frozen=True)
class Crowd(walls.Filmed):
    """A clip of people who are known."""

    @cached_property
    def parts(self) -> MovingParts:
        def cut(name: str, frame: int) -> Cut:
            known = Cut.known(walls.still(frame), standing(name, 5).astype(np.float32), 1.0)
            return replace(known, share=self.shows(name, frame).astype(np.float32))

        known = super().parts
        vars(known)["people"] = [
            ClipSubject(name, name, lambda frame, name=name: cut(name, frame)) for name in NAMES
        ]
        return known

    def shows(self, name: str, frame: int) -> Mask:
        return standing(name, frame)

    def subject_place(self, name: str, frame: int) -> Place:
        away = NAMES[name]
        followed = dict.fromkeys(walls.FRAMES, away)
        return Place(Focus(distance=away), frame, away, name, followed=followed)


def test_the_nearest_subject_in_the_first_frame_that_shows_one_is_in_focus() -> None:
    clip = walls.filmed(walls.still)
    found = nearest_subject(Crowd(clip.reconstruction, clip.read), NONE)
    assert found is not None and found.distance == NAMES["near"]
    assert found.source == "the nearest person" and sorted(found.followed) == list(walls.FRAMES)
    assert found.xy == pytest.approx((90 / WIDTH, 80 / HEIGHT), abs=0.01)


class Passed(Crowd):
    """The camera passes the nearest person of the first frames."""

    def shows(self, name: str, frame: int) -> Mask:
        return standing(name, frame) & (name != "near" or frame < 8)


def test_a_person_whom_the_camera_passes_is_not_in_focus() -> None:
    clip = walls.filmed(walls.still)
    found = nearest_subject(Passed(clip.reconstruction, clip.read), NONE)
    assert found is not None and found.distance == NAMES["far"]


class Coming(Crowd):
    """The crowd as it comes towards the camera."""

    def subject_place(self, name: str, frame: int) -> Place:
        followed = {each: NAMES[name] - 0.02 * each for each in walls.FRAMES}
        away = followed[frame]
        return Place(Focus(distance=away), frame, away, name, followed=followed)


def test_blur_is_measured_where_the_subject_is_neither_nearest_nor_farthest() -> None:
    """It is not seen in the first of 32 frames."""
    clip = walls.filmed(walls.still)
    found = nearest_subject(Coming(clip.reconstruction, clip.read), NONE)
    assert found is not None and found.frame == 17
    assert found.distance == found.followed[17] == NAMES["near"] - 0.02 * 17


def test_focus_goes_over_to_whoever_comes_nearer() -> None:
    clip = walls.filmed(walls.still)
    crowd = Crowd(clip.reconstruction, clip.read)
    found = nearest_person(crowd, 2)
    assert found.subject == "nearest person" and sorted(found.followed) == list(walls.FRAMES)
    inverse = np.array([1 / found.followed[frame] for frame in walls.FRAMES])
    # `late` is the nearest from frame 5 on; nobody is seen in the first frame.
    assert (np.diff(inverse) >= -1e-12).all() and inverse.max() <= 1 / NAMES["late"] + 1e-12
    with pytest.raises(UserError, match="no person was found"):
        nearest_person(clip, 2)


def test_focus_on_people_neither_flickers_nor_jumps() -> None:
    inverse = np.tile([[0.25], [0.5], [0.4]], (1, 80))
    shown = np.ones((3, 80), bool)
    shown[1, :40] = False  # Until then the third is the nearest,
    shown[2, 10:12] = False  # who is lost for two frames.
    weights = _weights(_nearest(inverse, shown), 3)
    assert weights.sum(axis=0) == pytest.approx(np.ones(80))
    focus = (weights * inverse).sum(axis=0)
    assert focus[:30] == pytest.approx(np.full(30, 0.4)) and focus[50:] == pytest.approx(np.full(30, 0.5))
    assert (np.diff(focus) >= -1e-12).all() and np.diff(focus).max() < 0.025


class Entering(Crowd):
    """The crowd, which the nearest person joins in the middle of the clip."""

    def shows(self, name: str, frame: int) -> Mask:
        return standing(name, 5) & (name != "late" or frame > 16)


def test_a_director_marks_who_enters() -> None:
    clip = walls.filmed(walls.still)
    marks = directed(Entering(clip.reconstruction, clip.read))
    assert [mark.name for mark in marks] == ["Nearest person", "Person enters"]
    assert [mark.places[0].distance for mark in marks] == [NAMES["near"], NAMES["late"]]
    first, second = marks
    # Half of the pull is before the entrance, as far as key frames know it.
    assert first.frame == 1 and second.pull == TURN and second.frame - TURN // 2 in range(16, 22)
    assert second.places[0].xy == pytest.approx((130 / WIDTH, 80 / HEIGHT), abs=0.01)
    with pytest.raises(UserError, match="no person was found"):
        directed(clip)


def test_a_director_names_its_reasons() -> None:
    frames, middle = list(range(100)), 50
    shown, faces = np.ones((2, 100), bool), np.zeros((2, 100), bool)
    cast = partial(_Cast, frames, [], [], np.ones((2, 100)))
    assert cast(shown, faces).reason(0, 0, None) == "Nearest person"
    assert cast(shown, faces).reason(middle, 1, 0) == "Comes nearer"
    late = shown & ((np.arange(100) >= middle) | [[True], [False]])
    assert cast(late, faces).reason(middle, 1, 0) == "Person enters"
    assert cast(late, late).reason(middle, 1, 0) == "Face enters"
    gone = shown & ((np.arange(100) < middle) | [[False], [True]])
    assert cast(gone, faces).reason(middle, 1, 0) == "Other leaves"
    # The first one turns away from the camera, or the second one to it.
    assert cast(shown, gone).reason(middle, 1, 0) == "Other turns away"
    assert cast(shown, late & [[False], [True]]).reason(middle, 1, 0) == "Face is seen"


def test_without_people_a_moving_object_is_in_focus() -> None:
    found = nearest_subject(walls.filmed(walls.with_disc), NONE)
    assert found is not None and found.source == "the nearest moving object" and found.xy is not None
    x, y = found.xy[0] * WIDTH, found.xy[1] * HEIGHT
    assert walls.disc(found.frame)[int(y), int(x)]
    assert nearest_subject(walls.filmed(walls.still, (1, 2, 3))) is None


def test_people_are_looked_for_once(tmp_path: Path) -> None:
    class Counting(Networks):
        calls = 0

        def poses(self, picture: Bytes, least: float) -> list[Detection]:
            self.calls += 1
            return super().poses(picture, least)

    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    clip = walls.filmed(walls.with_person, tuple(range(11, 17)))
    store = Store(tmp_path, lambda: 16 * "a")
    found = clip.reconstruction, clip.read, store
    first, second = (ClipSubjects(*found, Counting()) for _ in range(2))
    (person,) = first.people
    assert all(person.mask(frame).any() for frame in range(11, 17))
    (again,) = second.people
    assert (first.networks.calls > 0, second.networks.calls) == (True, 0)
    for frame in (11, 16):
        assert np.array_equal(again.cut(frame).share, person.cut(frame).share)
    # A damaged file.
    store.write(PEOPLE, {"frames": np.array([11]), "counts": np.array([5]), "places": np.zeros(8)})
    assert len(ClipSubjects(*found, Counting()).people) == 1
    nobody = clip.reconstruction, walls.still, Store(tmp_path, lambda: 16 * "b")
    assert ClipSubjects(*nobody, Counting()).people == ClipSubjects(*nobody, blind := Counting()).people == []
    assert blind.calls == 0


def test_a_correction_keeps_the_person_who_was_found() -> None:
    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    clip = walls.filmed(walls.with_person, tuple(range(11, 17)))
    found = ClipSubjects(clip.reconstruction, clip.read)
    (person,) = found.people
    strokes = Stroke(14, down(person.mask(14), 5)), Stroke(14, ((0.02, 0.02), (0.05, 0.02)), adds=False)
    marked = found.marked(MarkedSubject("subject", strokes))
    for frame in (11, 14, 16):
        shares = [walls.overlap(each.mask(frame), walls.person(frame)) for each in (marked, person)]
        assert shares[0] > shares[1] - 0.05, frame
    assert not found.others([marked], found.people)


def test_a_stroke_corrects_the_person_it_is_beside() -> None:
    masks = {name: standing(name, 5) for name in NAMES}
    assert nearest_to(Stroke(5, ((49 / WIDTH, 80 / HEIGHT),)), masks) == "far"
    x = (40 * 4 + 10) / WIDTH
    assert nearest_to(Stroke(5, ((x, 0.0), (x, 30 / HEIGHT))), masks) is None
    assert nearest_to(Stroke(5, ((x - 45 / WIDTH, 60 / HEIGHT),)), masks) == "late"
    assert nearest_to(Stroke(5, ((0.5, 0.5),)), {"nobody": np.zeros((HEIGHT, WIDTH), bool)}) is None


def test_brackets_are_round_the_known_subjects_of_a_frame() -> None:
    clip = walls.filmed(walls.still)
    crowd = Crowd(clip.reconstruction, clip.read)
    # Nothing is looked for.
    assert crowd.boxes(3) == []
    assert len(crowd.parts.every_subject) == len(NAMES)
    assert crowd.boxes(1) == []
    near = np.array([80 / WIDTH, 40 / HEIGHT, 100 / WIDTH, 120 / HEIGHT])
    for frame, shown in ((3, 2), (6, 3)):
        found = crowd.boxes(frame)
        assert len(found) == shown
        assert min(float(np.abs(box - near).max()) for box in found) < 1e-9


def test_a_face_is_found_on_a_person(data: Path) -> None:
    """Of two who talk, the one who faces the camera."""
    networks = Networks()
    if not networks.exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    stored = open_footage(data / "clips" / "people_two_talk_street_1.mp4").read(37)
    (person,) = people(networks, small(stored))
    box = face_of(networks, displayed(stored), person.mask)
    assert box is not None and (box[:2] + box[2:]) / 2 == pytest.approx((0.571, 0.392), abs=0.02)
