"""A frame's depth and mesh can be cancelled at every step, and leave nothing behind that is wrong."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from addon.core.base.progress import Cancelled, reporting
from addon.core.focus.focus import Focus
from addon.core.frame.frame import Frame
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import open_footage
from addon.core.media.light import to_linear
from addon.scene.sources.shot import Shot

from .. import planes
from ..planes import CENTRES, LENS, MIDDLE, clip, features, poses


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return planes.write_clip(tmp_path_factory.mktemp("cancel") / "clip", clip(CENTRES))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same at half the size."""
    return planes.write_clip(tmp_path_factory.mktemp("small") / "clip", planes.halved(clip(CENTRES)))


def fresh(folder: Path) -> Shot:
    """A clip with true cameras, of which nothing is remembered; its depth is found from its pictures."""
    footage = open_footage(folder)
    return Shot(footage, poses(CENTRES, features(), LENS.scaled(footage.width, footage.height)))


def warped(shot: Shot) -> Frame:
    lens = FrameOptions(Focus(distance=4.0), 0.2, 8)
    size = shot.footage.width, shot.footage.height
    return mesh_frame(shot.context, MIDDLE, lens, size, to_linear(shot.clip.read(MIDDLE))).through()


@pytest.mark.long
def test_every_stage_passes_many_checkpoints_and_goes_on(folder: Path) -> None:
    reports: list[tuple[str, float]] = []
    with reporting(lambda stage, share: reports.append((stage, share))):
        warped(fresh(folder))
    count = Counter(stage for stage, _ in reports)
    # At 320x240; rows and levels, and so checkpoints, grow with the picture.
    assert count["Depth"] > 1000 and count["Hidden surfaces"] > 10 and count["Mesh"] > 100, count
    shares = [share for _, share in reports]
    assert min(shares) >= 0 and max(shares) <= 1
    middles = [share for stage, share in reports if stage == "Depth"]
    assert len({round(share, 2) for share in middles}) > 10


@pytest.mark.long
def test_what_was_cancelled_anywhere_is_drawn_right_afterwards(small: Path) -> None:
    first = warped(fresh(small))
    total = 0

    def count(_stage: str, _share: float) -> None:
        nonlocal total
        total += 1

    with reporting(count):
        warped(fresh(small))
    shot = fresh(small)
    for at in np.random.default_rng(1).integers(1, total, 12):
        left = int(at)

        def stop(_stage: str, _share: float) -> None:
            nonlocal left
            left -= 1
            if left <= 0:
                raise Cancelled

        with reporting(stop), pytest.raises(Cancelled):
            warped(shot)
            # What is remembered from the tries before leaves fewer checkpoints.
            raise Cancelled
    again = warped(shot)
    for one, other in zip(again.layers, first.layers, strict=True):
        assert np.array_equal(one.picture, other.picture)
    assert np.array_equal(again.mesh.triangles, first.mesh.triangles)
    assert np.array_equal(again.mesh.inverse_depth, first.mesh.inverse_depth)
