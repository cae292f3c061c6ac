"""The scale of a clip by the height of its people."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pytest

from addon.core.base.arrays import Mask
from addon.core.depth.flat_scene import ADULT
from addon.core.focus.focus import Focus
from addon.core.focus.place import Place
from addon.core.frame.first_person import height_of, scale_by_people
from addon.core.frame.moving_parts import MovingParts
from addon.core.subjects.clip_subjects import ClipSubject
from addon.core.subjects.people import sampled

from . import walls


def person(top: int, bottom: int, width: int = 10) -> Mask:
    mask = np.zeros((walls.HEIGHT, walls.WIDTH), bool)
    mask[top:bottom, 50 : 50 + width] = True
    return mask


def test_only_upright_people_all_of_whom_is_seen_are_measured() -> None:
    assert height_of(person(20, 80)) == pytest.approx(60 / walls.HEIGHT)
    for cut in (person(0, 60), person(60, walls.HEIGHT), person(20, 80, 40), person(20, 26), person(0, 0)):
        assert height_of(cut) is None


class Crowd(walls.Filmed):
    """A clip of one person whose mask is given by frame."""

    masks: dict[int, Mask]

    @cached_property
    def parts(self) -> MovingParts:
        class Given(ClipSubject):
            def mask(own, frame: int) -> Mask:  # noqa: N805
                return self.masks[frame]

        known = super().parts
        vars(known)["people"] = [Given("person 1", "person1", lambda frame: None)]  # type: ignore[arg-type,return-value]
        return known

    def subject_place(self, name: str, frame: int) -> Place:
        return Place(Focus(distance=6.0), frame, 6.0, name, followed=dict.fromkeys(walls.FRAMES, 6.0))


def clip(masks: dict[int, Mask]) -> Crowd:
    filmed = walls.filmed(walls.still)
    made = Crowd(filmed.reconstruction, filmed.read)
    object.__setattr__(made, "masks", masks)
    return made


def test_the_scale_makes_people_as_tall_as_adults() -> None:
    made = clip(dict.fromkeys(walls.FRAMES, person(20, 80)))
    camera = made.canvas(walls.FRAMES[0]).camera
    units = 60 / walls.HEIGHT * camera.height / camera.fy * 6.0
    assert scale_by_people(made) == pytest.approx(ADULT / units)


def test_without_agreement_there_is_no_guess() -> None:
    assert scale_by_people(clip(dict.fromkeys(walls.FRAMES, person(0, 80)))) is None
    heights = {frame: 100 if number % 2 else 40 for number, frame in enumerate(sampled(walls.FRAMES))}
    assert scale_by_people(clip({frame: person(10, 10 + tall) for frame, tall in heights.items()})) is None
    assert scale_by_people(walls.filmed(walls.still)) is None
