"""Objects of the user's masks keep their numbers from frame to frame."""

from __future__ import annotations

import cv2
import numpy as np

from addon.core.base.arrays import Mask
from addon.core.base.errors import UserError
from addon.core.subjects.masked_objects import MaskedObjects

SIZE = (90, 160)


def boxes(*places: tuple[int, int], large: int = 4) -> Mask:
    """Squares of 20 x 20 pixels with their top left corners at places (x, y), in a mask of a larger size."""
    mask = np.zeros(SIZE, bool)
    for x, y in places:
        mask[y : y + 20, x : x + 20] = True
    size = SIZE[1] * large, SIZE[0] * large
    return cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0


def made(masks: list[Mask | None]) -> MaskedObjects:
    return MaskedObjects(range(1, len(masks) + 1), lambda frame: masks[frame - 1], SIZE)


def test_objects_are_followed_and_cover_the_whole_mask() -> None:
    masks = [boxes((5 + 6 * n, 10), (130 - 5 * n, 60)) for n in range(8)]
    objects = made([*masks])
    assert list(objects.numbers) == [1, 2]
    for frame, mask in enumerate(masks, 1):
        one, other = (objects.whole(number)(frame) for number in objects.numbers)
        np.testing.assert_array_equal(one ^ other, mask)
        assert np.count_nonzero(one) == np.count_nonzero(other)
    first = objects.whole(1)
    columns = [np.flatnonzero(first(frame).any(axis=0)).mean() for frame in range(1, 9)]
    steps = np.diff(columns) / 4
    assert np.allclose(steps, steps[0], atol=0.5), "the same object in each frame"


def test_two_objects_that_meet_are_another_object() -> None:
    masks = [boxes((10 + 8 * n, 30), (90, 30)) for n in range(9)]
    objects = made([*masks])
    together = [number for number in objects.numbers if objects.small(number, 8).any()]
    apart = [number for number in objects.numbers if objects.small(number, 1).any()]
    assert len(apart) == 2 and len(together) == 1 and together[0] not in apart


def test_specks_belong_to_the_nearest_object() -> None:
    mask = boxes((10, 10), (130, 60))
    mask[:4, 300:304] = True
    objects = made([mask])
    assert list(objects.numbers) == [1, 2]
    assert (objects.whole(1)(1) | objects.whole(2)(1)).sum() == mask.sum()


def test_a_damaged_mask_fails_in_its_own_frame_only() -> None:
    masks = [boxes((10 + 4 * n, 10)) for n in range(5)]

    def read(frame: int) -> Mask:
        if frame == 3:
            raise UserError("mask_0003.png cannot be decoded")
        return masks[frame - 1]

    objects = MaskedObjects(range(1, 6), read, SIZE)
    assert list(objects.numbers) == [1]
    assert objects.whole(1)(4).any() and not objects.small(1, 3).any()
