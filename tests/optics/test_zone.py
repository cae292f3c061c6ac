"""The in-focus zone: sharp within, a lens focused on its end outside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.source import DepthSource, PixelDepth
from addon.core.focus.focus import Focus, largest_discs, sharp_distances
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.passes import in_focus
from addon.core.frame.plan import FrameOptions
from addon.core.optics.thin_lens import ThinLens
from addon.core.optics.zone import InFocusZone
from benchmarks.displaced import displaced

PINHOLE = Intrinsics(160, 90, 150.0, 150.0, 80.0, 45.0)
ZONE = InFocusZone(front=0.25, behind=0.5, front_strength=0.5)
RADIUS = 0.2
SHAPES = [ZONE, InFocusZone(behind=3.0, behind_strength=0.0), InFocusZone(0.9, 0.0, 2.0, 0.25)]
LENSES = [
    ThinLens(PINHOLE, RADIUS, 0.2),
    ThinLens.on_plane(PINHOLE, RADIUS, 0.2, (4e-4, -6e-4)),
]


@pytest.mark.parametrize("zone", SHAPES)
@pytest.mark.parametrize("lens", LENSES, ids=["frontal", "tilted"])
def test_it_can_be_inverted_and_keeps_occlusion(zone: InFocusZone, lens: ThinLens) -> None:
    lens = replace(lens, zone=zone)
    inverse, xy = np.linspace(0, 3, 4001), np.tile([31.0, 70.0], (4001, 1))
    flat = lens.rectified(inverse, xy)
    assert (np.diff(flat) > 0).all()
    np.testing.assert_allclose(lens.unrectified(np.asarray(flat), xy), inverse, atol=1e-9)


def test_discs_within_are_nothing_and_outside_those_of_its_ends() -> None:
    plain = ThinLens(PINHOLE, RADIUS, 1 / 4)
    lens = replace(plain, zone=ZONE)
    within = np.linspace(3.01, 5.99, 50)
    assert np.abs(lens.blur_disc(np.asarray(lens.rectified_raster(1 / within[None])))).max() < 0.01
    behind, in_front = 1 / np.array([[7.0, 20.0, np.inf]]), 1 / np.array([[2.9, 1.5, 0.8]])
    for inverse, end, strength in ((behind, 6.0, 1.0), (in_front, 3.0, 0.5)):
        focused = replace(plain, focus=1 / end)
        expected = strength * focused.blur_disc(inverse)
        np.testing.assert_allclose(
            lens.blur_disc(np.asarray(lens.rectified_raster(inverse))), expected, atol=0.01
        )


class Steps(DepthSource):
    """Three steps of depth from left to right."""

    def at(self, frame: int, canvas, picture) -> PixelDepth:
        depth = np.repeat(1 / np.array([3.2, 4.0, 12.0]), [50, 60, 50])
        return PixelDepth(np.tile(depth.astype(np.float32), (90, 1)))


def reconstruction() -> Reconstruction:
    xyz = np.array([[-1.0, 0.2, 3.2], [0.0, 0.1, 4.0], [3.0, -0.5, 12.0], [0.1, -0.3, 4.0]])
    image = Image(1, np.eye(3), np.zeros(3), PINHOLE.project(xyz), np.arange(4, dtype=np.int32))
    return Reconstruction((PINHOLE,), (image,), Points(xyz, np.zeros((4, 3), np.uint8), np.zeros(4)))


def test_layers_of_a_zone_are_drawn_like_one_surface() -> None:
    picture = np.random.default_rng(0).random((90, 160, 4), np.float32)
    picture[..., 3] = 1
    clip = ClipContext(reconstruction(), lambda frame: np.zeros((90, 160, 3), np.uint8), Steps())
    options = FrameOptions(Focus(distance=4.0), RADIUS, zone_front=0.25, zone_behind=0.5, borrow=False)
    frame = mesh_frame(clip, 1, options, (160, 90), picture).through(16)
    mesh = frame.mesh
    moved = displaced(frame.views, mesh.xy, mesh.inverse_depth) - mesh.xy
    size = np.linalg.norm(moved, axis=-1).max(axis=0)
    # The far surface goes on behind the silhouette at 110.
    inside = (mesh.xy[:, 0] > 4) & (mesh.xy[:, 0] < 80)
    assert size[inside].max() < 0.01
    # A lens focused at 6, the end of the zone, moves the last step as far.
    reach = np.linalg.norm(frame.views.offsets, axis=1).max()
    expected = reach * PINHOLE.fx * (1 / 6 - 1 / 12)
    assert size[mesh.xy[:, 0] > 120].max() == pytest.approx(expected, rel=0.01)
    shown = in_focus(frame)
    assert shown[:, 4:100].min() == 1 and shown[:, 120:].max() == 0


def test_the_sharp_range_and_the_largest_discs_have_it() -> None:
    focus = Focus(distance=4.0)
    near, far = sharp_distances(reconstruction(), focus, 1, RADIUS)
    assert 3.9 < near < 4 < far < 4.1
    near, far = sharp_distances(reconstruction(), focus, 1, RADIUS, ZONE)
    assert 2.8 < near < 3 and 6 < far < 6.3
    assert sharp_distances(reconstruction(), focus, 1, RADIUS, InFocusZone(behind_strength=0))[1] == np.inf
    before, after = (
        largest_discs(reconstruction(), focus, 1, RADIUS, zone)[1] for zone in (InFocusZone(), ZONE)
    )
    assert 0 < after < before


def test_a_method_of_the_thesis_refuses_it() -> None:
    clip = ClipContext(reconstruction(), lambda frame: np.zeros((90, 160, 3), np.uint8), Steps())
    options = FrameOptions(Focus(points=(0, 1)), RADIUS, 8, "thesis", zone_behind=0.5)
    with pytest.raises(UserError, match="method thesis does not support an in-focus zone"):
        mesh_frame(clip, 1, options, (160, 90), np.ones((90, 160, 4), np.float32))
