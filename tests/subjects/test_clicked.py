"""A click on a subject that nobody has marked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Bytes, Mask
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.focus.place import Place
from addon.core.frame.clicked import clicked
from addon.core.frame.clip_context import ClipContext
from addon.core.subjects.clip_subjects import ClipSubject, ClipSubjects
from addon.core.subjects.cut import Cut
from addon.core.subjects.networks import Networks
from addon.core.subjects.strokes import MarkedSubject

from ..onnx_files import red
from . import walls
from .walls import HEIGHT, LENS, WIDTH, disc, filmed, overlap, place

FRAME, FEW = 16, tuple(range(11, 22))
RIM = 23
"""Pixels across by which a found object is wider than the disc in it."""


def click(
    clip: ClipContext,
    x: float,
    y: float,
    name: str = "Subject",
    seen: Callable[[Mask], object] = lambda mask: None,
) -> Place:
    """What a click at pixels of `FRAME` puts in focus."""

    def marking(new: MarkedSubject) -> ClipContext:
        return replace(clip, marked=(*clip.marked, new), known_subjects=clip._subjects)

    return clicked(clip, clip.places(FRAME), x / WIDTH, y / HEIGHT, name, marking, seen)


def at(frame: int) -> tuple[float, float]:
    """The middle of the disc, shares of the picture."""
    x, y = place(frame)
    return x / WIDTH, y / HEIGHT


@pytest.fixture(scope="module")
def clip() -> walls.Filmed:
    return filmed(walls.with_disc, FEW)


def test_a_click_on_an_object_that_was_found_takes_all_of_it(clip: walls.Filmed) -> None:
    seen = list[Mask]()
    found = click(clip, *place(FRAME), seen=seen.append)
    assert found.marks is None and "the subject object 1" in found.source
    assert sorted(found.followed) == list(FEW)
    (mask,) = seen
    assert overlap(mask, disc(FRAME)) > 0.85


def test_a_click_on_another_one_marks_all_of_it() -> None:
    clip, seen = unknown(walls.with_disc), list[Mask]()
    found = click(clip, *place(FRAME), name="Disc", seen=seen.append)
    assert found.marks is not None and found.marks.name == "Disc" and "the subject Disc" in found.source
    assert sorted(found.followed) == list(FEW)
    assert found.xy == (place(FRAME)[0] / WIDTH, place(FRAME)[1] / HEIGHT)
    marked = replace(clip, marked=(found.marks,), known_subjects=clip._subjects)
    assert min(overlap(marked.parts.named("Disc").mask(frame), disc(frame)) for frame in FEW) > 0.75
    # The next click finds it, beside its outline, too.
    again = click(marked, *place(FRAME), seen=seen.append)
    assert again.marks is None and "the subject Disc" in again.source
    assert again.distance == pytest.approx(found.distance)
    for mask in seen:
        assert np.array_equal(mask, marked.parts.named("Disc").mask(FRAME))
    assert len(seen) == 2


def test_a_click_on_a_small_part_that_was_found_marks_the_whole(clip: walls.Filmed) -> None:
    subjects = ClipSubjects(clip.reconstruction, clip.read, networks=Networks(walls.NONE))
    part = np.zeros((HEIGHT, WIDTH), bool)

    def cut(frame: int) -> Cut:
        there = part.copy()
        x, y = (round(each) for each in place(frame))
        there[y - 3 : y + 4, x - 3 : x + 4] = True
        picture = subjects.pictures.picture(frame)
        size = picture.shape[1::-1]
        share = cv2.resize(there.astype(np.float32), size, interpolation=cv2.INTER_NEAREST)
        return Cut.known(picture, share, 1.0)

    vars(subjects)["objects"] = [ClipSubject("object 1", "object1", cut, kind="object")]
    found = click(replace(clip, known_subjects=subjects), *place(FRAME), name="Disc")
    assert found.marks is not None
    assert overlap(subjects.marked(found.marks).mask(FRAME), disc(FRAME)) > 0.75


def red_disc(frame: int) -> Bytes:
    """The clip with a disc that the network of `red` finds."""
    picture = walls.with_disc(frame)
    picture[disc(frame)] = 200, 30, 40
    return picture


@pytest.mark.parametrize(("right", "is_part"), [(0, True), (30, False)], ids=["whole", "beside"])
def test_a_cut_of_the_segmenter_is_the_subject_unless_it_is_a_part(
    tmp_path: Path, right: int, is_part: bool
) -> None:
    """A found object of three times the disc's area, about it or so far beside it that half of it is out."""
    clip, file = filmed(red_disc, FEW), tmp_path / "red.onnx"
    file.write_bytes(red())
    subjects = ClipSubjects(clip.reconstruction, clip.read, networks=Networks(walls.NONE, file))

    def cut(frame: int) -> Cut:
        picture = subjects.pictures.picture(frame)
        found = cv2.dilate(disc(frame).astype(np.uint8), np.ones((RIM, RIM), np.uint8))
        found = np.roll(found, right, axis=1).astype(np.float32)
        return Cut.known(picture, cv2.resize(found, picture.shape[1::-1]), 1.0)

    vars(subjects)["objects"] = [ClipSubject("object 1", "object1", cut, kind="object")]
    x, y = place(FRAME)
    found = click(replace(clip, known_subjects=subjects), x + right / 2, y, name="Disc")
    assert (found.marks is None) == is_part


def test_a_click_on_a_person_shows_a_body_before_people_are_searched() -> None:
    if not Networks().exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    drawn, seen = filmed(walls.with_person, FEW), list[Mask]()
    clip = replace(drawn, known_subjects=ClipSubjects(drawn.reconstruction, drawn.read))
    y, x = np.argwhere(walls.person(FRAME)).mean(axis=0)
    found = click(clip, x, y, seen=seen.append)
    assert "the subject person 1" in found.source
    first, last = seen
    assert overlap(first, last) > 0.7 and clip.parts.subjects.knows_people
    click(clip, x, y, seen=seen.append)
    assert len(seen) == 3 and np.array_equal(seen[2], last)


def test_a_click_on_what_stands_still_is_as_without_subjects(clip: walls.Filmed) -> None:
    seen = list[Mask]()
    found = click(clip, 200, 140, seen=seen.append)
    assert not seen
    assert found.marks is None and not found.followed
    assert found.distance == pytest.approx(walls.NEAR, rel=0.03)
    assert str(found) == str(clip.places(FRAME).find(200 / WIDTH, 140 / HEIGHT))


@dataclass(frozen=True)
class Unknown(walls.Filmed):
    """The clip with features of the near wall alone, and depth that is not sure anywhere."""

    @cached_property
    def stereo(self) -> Unknown:  # type: ignore[override]
        return self

    def at(self, frame: int) -> DenseDepth:
        """What stereo is asked for."""
        nothing = np.zeros((HEIGHT, WIDTH), np.float32)
        return DenseDepth(frame, nothing + 0.2, nothing, nothing > 0, LENS)

    def kept(self, frame: int) -> None:
        """Nothing."""


def test_a_click_where_nothing_is_known_marks_a_subject_but_no_background() -> None:
    clip = unknown(walls.with_disc)
    x, y = place(FRAME)
    assert clip.places(FRAME).find(x / WIDTH, y / HEIGHT).is_estimated
    found = click(clip, x, y)
    assert found.marks is not None and found.distance == pytest.approx(walls.FAR, rel=0.01)
    nothing = click(unknown(walls.still), 30, 30)
    assert nothing.is_estimated and nothing.marks is None


def unknown(shown: Callable[[int], Bytes]) -> Unknown:
    """A clip of pictures, of which nothing is known around the disc."""
    made = filmed(shown, FEW)
    images = []
    for image in made.reconstruction.images:
        far = image.xy[:, 1] > walls.EDGE
        images.append(replace(image, xy=image.xy[far], points=image.points[far]))
    found = replace(made.reconstruction, images=tuple(images))
    nobody = walls.NoObjects(found, shown, networks=Networks(walls.NONE))
    return Unknown(found, shown, known_subjects=nobody)
