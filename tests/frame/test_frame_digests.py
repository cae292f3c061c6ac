"""Frames are equal to the bit to those that were drawn when their digests were kept: see `frame_digests`."""

from __future__ import annotations

from pathlib import Path

import pytest

from addon.render.views.gpu_views import gpu_problem

from . import frame_digests
from .frame_digests import CASES, REAL

STAGED = tuple(name for name in CASES if name not in REAL)


@pytest.fixture(scope="module")
def known() -> dict[str, dict[str, str]]:
    """The digests of this platform; others have other last bits."""
    if problem := gpu_problem():
        pytest.skip(f"frames are not compared: {problem}")
    kept = frame_digests.stored()
    here = frame_digests.this_platform()
    other = [
        f"{key} is {here[key]!r}, was {kept['platform'][key]!r}"
        for key in here
        if here[key] != kept["platform"][key]
    ]
    if other:
        pytest.skip(f"frames are not compared, their digests are of another platform: {'; '.join(other)}")
    return kept["digests"]


@pytest.mark.parametrize("name", STAGED)
def test_a_frame_of_a_scene_is_as_before(known: dict[str, dict[str, str]], name: str) -> None:
    compare(known, name)


@pytest.mark.parametrize("name", REAL)
def test_a_frame_of_a_clip_is_as_before(known: dict[str, dict[str, str]], data: Path, name: str) -> None:
    compare(known, name)


def compare(known: dict[str, dict[str, str]], name: str) -> None:
    found = frame_digests.digests(frame_digests.drawn(CASES[name]))
    assert found["shown"] == known[name]["shown"], f"{name}: the picture differs in 8 bits"
    assert found["bits"] == known[name]["bits"], f"{name}: the picture differs in its last bits"
