"""Debug views and reports: what they show is what the frame is drawn from."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.base.arrays import LinearRGB, Mask
from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext, no_picture
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.inspection import (
    NAMES,
    blur_discs,
    picture,
    pictures,
)
from addon.core.frame.plan import FrameOptions
from addon.core.frame.report import frame_report
from addon.core.media.light import to_linear, to_rgb8
from addon.core.warp.layered_depth_image import Fill
from addon.render.views.average import draw_shares

from ..disc_and_wall import (
    FAR,
    NEAR,
    SIZE,
    X,
    Y,
    disc_and_wall,
)
from ..scenes import LENS as PLAIN
from ..scenes import slanted_plane, texture

Floats = NDArray[np.float64]
RED, GREEN, BLUE = range(3)


def lends(what: Callable[[Floats], Mask]) -> Fill:
    """Other frames' colours where `what` says so of the pixels asked for."""

    def fill(shift: Floats, wanted: Mask) -> tuple[LinearRGB, Mask]:
        return np.full((*shift.shape, 3), 0.5, np.float32), wanted & what(shift)

    return fill


# Sources


def test_shares_make_one_where_the_frame_is_whole() -> None:
    shares = draw_shares(disc_and_wall())
    assert shares.shape == (*SIZE, 3) and shares.dtype == np.float32
    assert shares.min() >= 0
    np.testing.assert_allclose(shares.sum(axis=2), 1, atol=1e-4)
    inner = np.s_[12:-12, 12:-12]
    # Nothing is lent; what the disc hides is made up, as far as the aperture sees.
    assert shares[..., GREEN].max() == 0
    away = np.abs(np.hypot(X - 80, Y - 60) - 30)
    assert shares[..., RED][inner][away[inner] < 4].max() > 0.2
    assert shares[..., RED][inner][away[inner] > NEAR - FAR + 3].max() < 1e-4


def test_what_is_lent_is_not_made_up() -> None:
    alone, half, all_ = (
        draw_shares(disc_and_wall(fill=fill)).mean(axis=(0, 1))
        for fill in (
            None,
            lends(lambda s: np.arange(s.shape[1]) < 80),
            lends(lambda s: np.ones(s.shape, bool)),
        )
    )
    assert alone[GREEN] == 0 < 0.2 * all_[GREEN] < half[GREEN] < all_[GREEN]
    assert alone[RED] > half[RED] > all_[RED] == 0
    np.testing.assert_allclose([alone[BLUE], half[BLUE]], all_[BLUE], atol=1e-4)
    assert alone[BLUE] > 0.9


def plane(camera: Intrinsics = PLAIN) -> ClipContext:
    """A slanted plane for the methods that need no depth of every pixel."""
    return ClipContext(slanted_plane(camera), no_picture)


@pytest.mark.parametrize("method", ["features", "thesis"])
def test_a_single_surface_is_the_frames_own_but_for_the_border(method: str) -> None:
    source = to_linear(texture(160, 90))
    lens = FrameOptions(Focus(points=(3, 9, 30, 60)), 0.5, 24, method)
    frame = mesh_frame(plane(), 2, lens, (160, 90), source).through()
    shares = draw_shares(frame)
    assert shares[..., GREEN].max() == 0
    np.testing.assert_allclose(shares[12:-12, 12:-12, BLUE], 1, atol=1e-4)
    if method == "thesis":
        # Its border is pinned: views show nothing past it, and what they leave is nobody's.
        assert shares[..., RED].max() < 0.1
        assert shares.sum(axis=2).min() <= 1 + 1e-4
    else:
        assert shares[:, 0, RED].max() > 0.2
        np.testing.assert_allclose(shares.sum(axis=2), 1, atol=1e-4)
    made = pictures(frame, shares)
    assert tuple(made) == NAMES
    report = frame_report(frame, shares)
    assert report.sure is None and report.triangles == len(frame.mesh.triangles)
    assert "%" in "\n".join(report.words())


# Pictures


def test_all_pictures() -> None:
    frame = disc_and_wall(fill=lends(lambda s: np.arange(s.shape[1]) < 90))
    shares = draw_shares(frame)
    made = pictures(frame, shares)
    assert tuple(made) == NAMES
    for name, shown in made.items():
        assert shown.dtype == np.uint8
        assert shown.shape == (*SIZE, 3), name
    inside, outside = (60, 80), (10, 10)
    # Near is red, far is blue.
    assert made["depth"][inside][0] > made["depth"][inside][2]
    assert made["depth"][outside][2] > made["depth"][outside][0]
    assert (np.abs(made["blur"][inside].astype(int) - 255) <= 1).all()
    assert made["blur"][outside][2] > made["blur"][outside][0] + 60


# Reports


def test_the_report_is_that_of_the_mesh() -> None:
    frame = disc_and_wall()
    shares = draw_shares(frame)
    report = frame_report(replace(frame, draw_seconds=2.5), shares)
    triangles = len(frame.mesh.triangles)
    assert report.triangles == triangles
    assert report.of_pixel_grid == pytest.approx(100 * triangles / (2 * SIZE[0] * SIZE[1]))
    assert report.own + report.borrowed + report.inpainted == pytest.approx(100, abs=0.01)
    assert report.sure == pytest.approx(50)
    assert (report.frame, report.method, report.why, report.views) == (
        1,
        "layers",
        "its depth is sure enough",
        24,
    )
    # Most is the wall, whose disc is twice what the rim displaces.
    assert report.blur_median == report.blur_largest == pytest.approx(2 * (NEAR - FAR))
    assert report.draw_seconds == 2.5
    assert json.loads(json.dumps(report.as_dict()))["triangles"] == triangles
    text = "\n".join(report.words())
    assert f"{triangles:,} triangles" in text and "layers with 24 views: its depth is sure enough" in text
    given = frame_report(replace(frame, depth=replace(frame.depth, confidence=None)), shares)
    assert given.why == "its depth is known" and given.sure is None


def test_what_is_in_focus_is_clear_and_the_rest_is_tinted() -> None:
    source = np.full((90, 160, 4), 0.2, np.float32)
    frame = mesh_frame(
        plane(), 2, FrameOptions(Focus(points=(3, 9, 30, 60)), 0.5, 8, "features"), (160, 90), source
    ).through()
    shown = picture("focus", frame)
    assert shown is not None
    disc = blur_discs(frame)
    clear = np.abs(disc) < frame.lens.acceptable_disc
    grey = to_rgb8(source)
    assert clear.any() and np.array_equal(shown[clear], grey[clear])
    tint = shown.astype(int) - grey
    near, far = (np.nanmax(sign * disc) * sign for sign in (1, -1))
    assert (tint[disc == near][:, 2] > tint[disc == near][:, 1]).all()
    assert (tint[disc == far][:, 1] > tint[disc == far][:, 2]).all()
