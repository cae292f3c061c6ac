"""Decoding of the small networks, on the files that the build fetches."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.subjects.networks import Networks, Region
from tests.conftest import ROOT

from .figures import figure


@pytest.fixture(scope="module")
def networks() -> Networks:
    found = Networks()
    if not found.exist:
        pytest.skip("the networks are not in addon/networks: run tools/networks.py")
    return found


def test_the_files_are_those_that_the_code_loads(networks: Networks) -> None:
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        from networks import OUT, names
    finally:
        sys.path.pop(0)
    assert all((OUT / name).is_file() for name in names())
    assert (OUT / "LICENSE.txt").is_file() and (OUT / "NOTICE.txt").is_file()


def test_nothing_is_detected_in_a_plain_picture(networks: Networks) -> None:
    plain = np.full((180, 320, 3), 128, np.uint8)
    assert not networks.poses(plain, 0.3)
    assert not networks.faces(plain, 0.5)


def test_a_figure_is_detected_and_its_mask_covers_it(networks: Networks) -> None:
    picture = figure()
    (person,) = networks.poses(picture, 0.3)
    mask, presence, after = networks.body(picture, Region.of(person))
    drawn = np.abs(picture.astype(int) - picture[0, 0]).sum(axis=2) > 30
    assert presence > 0.5
    union = np.count_nonzero((mask > 0.5) | drawn)
    assert np.count_nonzero((mask > 0.5) & drawn) / union > 0.6
    # The network's own area of the person is that of the detector, and shows the person again.
    region = Region.of(person)
    assert np.linalg.norm(after.centre - region.centre) < 0.1 * region.side
    assert after.side == pytest.approx(region.side, rel=0.25) and after.up @ region.up > 0.95
    again, presence, _ = networks.body(picture, after)
    union = np.count_nonzero((again > 0.5) | (mask > 0.5))
    assert presence > 0.5 and np.count_nonzero((again > 0.5) & (mask > 0.5)) / union > 0.85


def test_a_build_without_networks_reports_so(tmp_path: object) -> None:
    none = Networks(tmp_path)  # type: ignore[arg-type]
    assert not none.exist
    with pytest.raises(UserError, match="this build of the extension has no networks"):
        none.poses(np.zeros((10, 10, 3), np.uint8), 0.3)
