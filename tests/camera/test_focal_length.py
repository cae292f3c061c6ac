"""Focal lengths in pixels from what is written on lenses."""

from __future__ import annotations

import pytest

from addon.core.base.errors import UserError
from addon.core.camera.focal_length import from_equivalent, from_field_of_view, from_sensor, in_pixels


def test_a_lens_is_the_same_by_all_its_names() -> None:
    # 36 mm of film across and 24 down: a 43.27 mm lens sees the diagonal under 53.13 degrees.
    assert from_equivalent(36.0, 3600, 2400) == pytest.approx(3600)
    assert from_field_of_view(90.0, 1000) == pytest.approx(500)
    # Half the sensor's width before it is the same 90 degrees.
    assert from_sensor(11.8, 23.6, 1000) == pytest.approx(500)
    assert from_sensor(36.0, 36.0, 3600) == pytest.approx(3600)
    assert in_pixels(lambda width, height: 2.0 * width + height, 300, 200) == 800
    assert in_pixels(450.0, 300, 200) == 450


@pytest.mark.parametrize("bad", [0.0, -3.0, float("nan"), float("inf")])
def test_a_length_that_cannot_be_is_named(bad: float) -> None:
    for tell in (
        lambda: from_equivalent(bad, 1000, 500), lambda: from_sensor(bad, 36.0, 1000),
        lambda: from_sensor(35.0, bad, 1000), lambda: in_pixels(bad, 1000, 500),
        lambda: in_pixels(lambda width, height: bad, 1000, 500),
    ):  # fmt: skip
        with pytest.raises(UserError, match=f"is {bad:g} (mm|pixels); it must be"):
            tell()


@pytest.mark.parametrize("bad", [0.0, -3.0, 180.0, 200.0, float("nan"), float("inf")])
def test_a_field_of_view_that_cannot_be_is_named(bad: float) -> None:
    with pytest.raises(UserError, match=f"is {bad:g} degrees"):
        from_field_of_view(bad, 1000)
