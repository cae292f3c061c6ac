"""Which mesh a frame gets, and the reason that is given where it is not the one asked for."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import LinearRGBA
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.source import SURE, PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.effects import FEWEST_SURE
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.media.light import to_linear
from addon.core.warp.layer import BORROWED, INPAINTED

from ..scenes import slanted_plane, texture

LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
SIZE = (160, 90)
FOCUS = 8.0
SOURCE = to_linear(texture(*SIZE))


@dataclass
class ByHand:
    """Depth that was made by hand."""

    confidence: NDArray[np.float32]
    requested: list[int] = field(default_factory=list)

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        self.requested.append(frame)
        assert picture.shape[:2] == (canvas.pinhole.height, canvas.pinhole.width) == SIZE[::-1]
        inverse = np.where(np.arange(SIZE[0]) < SIZE[0] / 2, 1 / FOCUS, 1 / 12)
        return PixelDepth(np.tile(inverse, (SIZE[1], 1)), self.confidence)

    def samples(self, frame: int, canvas: Canvas) -> None:
        return None


def clip(depth: ByHand, near: float = 5.0, far: float = 12.0) -> ClipContext:
    """A plane of which every frame shows the same, so that none tells of what another hides."""
    return ClipContext(slanted_plane(LENS, near=near, far=far), lambda frame: texture(*SIZE), depth)


def sure_in(share: float) -> NDArray[np.float32]:
    """Confidence that is over the threshold in a share of the picture."""
    confidence = np.full(90 * 160, 0.5 * SURE, np.float32)
    confidence[: round(share * confidence.size)] = 1
    return confidence.reshape(90, 160)


def warped(
    confidence: NDArray[np.float32], radius: float = 0.5, method: str = "layers", borrow: bool = False
) -> tuple[Frame, ByHand]:
    depth = ByHand(confidence)
    lens = FrameOptions(Focus(distance=FOCUS), radius, 8, method, borrow=borrow)
    return mesh_frame(clip(depth), 2, lens, SIZE, SOURCE).through(), depth


@pytest.mark.parametrize("borrow", [False, True])
def test_layers_are_the_default(borrow: bool) -> None:
    assert FrameOptions(Focus(distance=FOCUS), 0.5).method == "layers"
    made, depth = warped(sure_in(1.0), borrow=borrow)
    assert (made.mesher.name, made.why) == ("layers", "") and made.is_whole
    assert depth.requested == [2] and made.number == 2
    front, back = made.layers
    assert front.origin.shape == back.origin.shape and (back.origin == INPAINTED).any()
    assert (front.origin == BORROWED).any() == borrow
    assert made.depth is not None and made.depth.inverse_depth.shape == (90, 160)
    assert made.depth.confidence is not None and made.depth.confidence.min() == 1
    assert made.depth_seconds > 0 and made.mesh_seconds > 0


def test_where_hardly_anything_is_sure_features_are_drawn_and_the_reason_given() -> None:
    made, _ = warped(sure_in(0.5 * FEWEST_SURE))
    assert made.mesher.name == "features" and f"less than {100 * FEWEST_SURE:g}%" in made.why
    assert len(made.layers) == 1 and made.depth is not None
    chosen, _ = warped(sure_in(1.0), method="features")
    assert (chosen.mesher.name, chosen.why) == ("features", "")
    np.testing.assert_array_equal(made.mesh.xy, chosen.mesh.xy)
    np.testing.assert_array_equal(made.mesh.inverse_depth, chosen.mesh.inverse_depth)
    np.testing.assert_array_equal(made.layers[0].picture, chosen.layers[0].picture)
    # A little more is enough.
    assert warped(sure_in(2 * FEWEST_SURE))[0].mesher.name == "layers"


def test_discs_that_leave_nothing_take_the_features_and_say_so() -> None:
    made, depth = warped(sure_in(1.0), radius=20.0)
    assert made.mesher.name == "features" and "too large for layers" in made.why
    assert not depth.requested and made.depth is None
    chosen, _ = warped(sure_in(1.0), radius=20.0, method="features")
    assert (chosen.mesher.name, chosen.why) == ("features", "")
    np.testing.assert_array_equal(made.mesh.triangles, chosen.mesh.triangles)


@pytest.mark.parametrize("method", ["features", "thesis"])
def test_a_method_that_is_asked_for_is_used(method: str) -> None:
    picks = Focus(points=(3, 9, 30, 60))
    lens = FrameOptions(picks, 0.5, 8, method)
    depth = ByHand(sure_in(0))
    made = mesh_frame(clip(depth), 2, lens, SIZE, SOURCE).through()
    assert (made.mesher.name, made.why) == (method, "")
    assert not depth.requested
    np.testing.assert_array_equal(made.layers[0].picture, SOURCE)
