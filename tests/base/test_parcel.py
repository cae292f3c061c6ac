"""Python values as bytes for another of our processes."""

from __future__ import annotations

import pickle
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.errors import Remedy, UserError
from addon.core.base.parcel import ROOT, pack, unpack
from addon.core.media.clip import FrameRange, open_footage
from addon.core.media.masks import open_masks

from ..foreign_models import write_clip


def test_values_arrays_and_our_classes_come_back() -> None:
    values = {
        "path": Path("clip.mp4"),
        "array": np.arange(6, dtype=np.float32).reshape(2, 3),
        "half": np.float16(0.5),
        "range": FrameRange(1, 9, 2),
        "nothing": (None, True, frozenset({1})),
    }
    back = unpack(pack(values))
    assert np.array_equal(back.pop("array"), values.pop("array"))
    assert back == values
    error = unpack(pack(UserError("no clip", Remedy.FRAMES)))
    assert (str(error), error.remedies) == ("no clip", (Remedy.FRAMES,))


def test_what_a_dataclass_has_cached_stays_behind(tmp_path: Path) -> None:
    footage = open_footage(write_clip(tmp_path / "clip"))
    assert footage.fills_display_window and "fills_display_window" in vars(footage)
    there = unpack(pack(footage))
    assert there == footage and "fills_display_window" not in vars(there)


def test_the_package_may_have_another_name() -> None:
    data = pack(FrameRange(1, 2))
    there = data.replace(ROOT.encode(), b"addin")
    assert there != data and unpack(there) == FrameRange(1, 2)


@pytest.mark.parametrize("call", [partial(eval, "1"), Path.unlink, partial(pickle.loads, b"")])
def test_functions_of_others_are_refused(call: object) -> None:
    with pytest.raises(pickle.UnpicklingError, match="is not of this package"):
        unpack(pack(call))


def test_pictures_beside_a_clip_are_opened_again(tmp_path: Path) -> None:
    footage = open_footage(write_clip(tmp_path / "clip"))
    masks = open_masks(write_clip(tmp_path / "masks"), footage)
    there = unpack(pack(masks))
    assert there == masks and there is not masks
    frame = masks.frames[0]
    assert np.array_equal(there.at(frame), masks.at(frame))
