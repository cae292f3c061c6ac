"""CG objects as layers: where they are, how far they are blurred, and what they hide."""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.base.arrays import Floats, Map
from addon.core.camera.reconstruction import Intrinsics
from addon.core.frame.cg_layers import CGObjects
from addon.core.optics.thin_lens import ThinLens
from addon.core.warp.cg_layer import STEP, CGLayer

PINHOLE = Intrinsics(64, 48, 100.0, 100.0, 32.0, 24.0)
MARGIN = 8
NEAR, FOCUS = 1 / 2, 1 / 4
SQUARE = slice(20, 30), slice(30, 45)
"""Rows and columns of a square, with the margin."""


def layer(inverse: float = NEAR) -> CGLayer:
    picture = np.zeros((48 + 2 * MARGIN, 64 + 2 * MARGIN, 4), np.float32)
    picture[SQUARE] = (0.2, 0.4, 0.6, 1.0)
    depth = np.where(picture[..., 3] > 0, np.float32(inverse), np.float32(0))
    found = CGLayer.of(picture, depth, MARGIN, 0.1)
    assert found is not None
    return found


def test_it_is_cut_out_at_its_place() -> None:
    made = layer()
    assert made.corner == (30 - MARGIN, 20 - MARGIN) and made.picture.shape == (10, 15, 4)
    assert made.places()[0, 0].tolist() == [22.5, 12.5]
    assert CGLayer.of(np.zeros((8, 8, 4), np.float32), np.zeros((8, 8), np.float32), 0, 1.0) is None


def test_half_covered_pixels_are_as_far_as_the_covered_ones_beside() -> None:
    picture = np.ones((5, 5, 4), np.float32)
    picture[:, 4] = 0.2
    depth = np.full((5, 5), NEAR, np.float32)
    # What the one sample of depth saw there.
    depth[:, 4] = 0.01
    found = CGLayer.of(picture, depth, 0, 0.0)
    assert found is not None and (found.inverse_depth == np.float32(NEAR)).all()


def test_no_light_is_lost_in_its_blur_and_triangles_cover_all_of_it() -> None:
    lens = ThinLens(PINHOLE, 0.2, FOCUS)
    made = layer()
    drawn = made.layer(lens, 9, 1.0)
    mesh, texture = drawn.mesh, drawn.picture
    assert texture.sum(axis=(0, 1)) == pytest.approx(made.picture.sum(axis=(0, 1)), rel=2e-3)
    # The radius is R f (1 / 2 - 1 / 4) = 5 pixels, a third of it is blurred before: so far past the edges.
    assert made.largest_disc(lens) == pytest.approx(10.0)
    low, high = mesh.xy.min(axis=0), mesh.xy.max(axis=0)
    assert (low < [22 - 1.0, 12 - 1.0]).all() and (high > [37 + 1.0, 22 + 1.0]).all()
    assert (low > [22 - 6.0, 12 - 6.0]).all()
    assert np.allclose(mesh.inverse_depth, NEAR)
    corners = mesh.xy[mesh.triangles]
    sides = corners[:, 1:] - corners[:, :1]
    areas = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) / 2
    assert np.allclose(areas, STEP**2 / 2) and areas.sum() >= np.count_nonzero(texture[..., 3])


def test_in_focus_it_is_as_cycles_drew_it() -> None:
    made = layer(FOCUS)
    drawn = made.layer(ThinLens(PINHOLE, 0.2, FOCUS), 9, 1.0)
    mesh, texture = drawn.mesh, drawn.picture
    place = np.round(mesh.texture_xy[0] - mesh.xy[0]).astype(int) + made.corner
    rows, columns = slice(place[1], place[1] + 10), slice(place[0], place[0] + 15)
    assert np.array_equal(texture[rows, columns], made.picture)


def test_aberrations_widen_its_blur_by_place() -> None:
    made, seen = layer(), list[Floats]()

    def twice(displacement: Map, xy: Floats) -> Map:
        seen.append(xy[0, 0])
        return 2 * displacement

    lens, wider = (ThinLens(PINHOLE, radius, FOCUS) for radius in (0.2, 0.4))
    found, expected = made.layer(lens, 9, 1.0, twice), made.layer(wider, 9, 1.0)
    np.testing.assert_array_equal(found.picture, expected.picture)
    assert np.array_equal(seen[0], np.array(made.corner) + 0.5) and (seen[1] < seen[0]).all()


def test_shadows_dim_the_clip_and_not_its_alpha() -> None:
    picture = np.ones((2, 2, 4), np.float32)
    shadow = np.full((2, 2, 3), 0.25, np.float32)
    assert CGObjects((), shadow).shaded(picture)[0, 0].tolist() == [0.25, 0.25, 0.25, 1.0]
    assert CGObjects().shaded(picture) is picture
