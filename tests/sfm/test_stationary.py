"""Whether a clip tells depth: simulated tracks of pans through lenses that are no pinholes, and of paths.

Points lie at 1.2 to 7.5 m, tracks have the errors of optical flow: noise, and drift along them.
"""

from __future__ import annotations

import numpy as np
import pytest

from addon.core.base.arrays import Floats
from addon.core.camera.reconstruction import rotation_matrix, rotation_vector
from addon.core.sfm.adjustment import solution
from addon.core.sfm.adjustment.bundle_adjustment import adjust
from addon.core.sfm.calibration import self_calibration, stationary
from addon.core.sfm.report import Figures, report
from addon.core.sfm.tracking.tracks import Tracks

from .. import foreign_models

SIZE = np.array([640, 360])
CORNER = float(np.hypot(*SIZE)) / 2
FOCAL, FRAMES, POINTS = 700.0, 12, 300


class Filmed:
    """A head that turns by 20 degrees, slowly, fast and slowly again, while it slides to the side."""

    def __init__(
        self, path: float = 0.0, distortion: float = 0.0, readout: float = 0.0, zoom: float = 0.0,
        plane: bool = False, degrees: float = 20.0,
    ) -> None:  # fmt: skip
        rng = np.random.default_rng(0)
        share = -np.cos(np.pi * np.linspace(0, 1, FRAMES)) / 2
        sway = np.radians(0.2) * rng.normal(0, 1, (FRAMES, 3))
        turn = np.radians(degrees) * share[:, None] * [0, -1, 0] + sway
        self.rotation = np.array([rotation_matrix(each) for each in turn])
        centre = path * share[:, None] * [1, 0, 0]
        self.translation = -np.einsum("fij,fj->fi", self.rotation, centre)
        self.focal = FOCAL * np.linspace(1 - zoom / 2, 1 + zoom / 2, FRAMES)
        rays = np.column_stack([rng.uniform([-0.45, -0.28], [0.45, 0.28], (POINTS, 2)), np.ones(POINTS)])
        slanted = 3 / (rays @ [0.15, 0.1, 1.0])
        self.xyz = rays * (slanted if plane else 1 / rng.uniform(1 / 7.5, 1 / 1.2, POINTS))[:, None]
        drift = np.cumsum(rng.normal(0, 0.03, (FRAMES, POINTS, 2)), axis=0)
        frame, track, xy = [], [], []
        for index in range(FRAMES):
            error = drift[index] + rng.normal(0, 0.15, (POINTS, 2))
            place = self._seen(index, distortion, readout) + error
            inside = np.nonzero(np.all((place > 0) & (place < SIZE), axis=1))[0]
            frame.append(np.full(len(inside), index))
            track.append(inside)
            xy.append(place[inside])
        self.tracks = Tracks(
            tuple(range(1, FRAMES + 1)), int(SIZE[0]), int(SIZE[1]), np.concatenate(frame).astype(np.int32),
            np.concatenate(track).astype(np.int32), np.concatenate(xy), np.zeros((POINTS, 3), np.uint8),
        )  # fmt: skip

    def _seen(self, index: int, distortion: float, readout: float) -> Floats:
        """(P, 2) pixels; `distortion` is how much nearer to the middle the corner is, `readout` in frames."""
        before, after = max(index - 1, 0), min(index + 1, FRAMES - 1)
        spin = rotation_vector(self.rotation[after] @ self.rotation[before].T) / (after - before)
        local = self.xyz @ self.rotation[index].T + self.translation[index]
        place = self.focal[index] * local[:, :2] / local[:, 2:]
        for _ in range(8):
            when = readout * place[:, 1:] / SIZE[1]
            turned = local + np.cross(when * spin, local)
            ideal = self.focal[index] * turned[:, :2] / turned[:, 2:]
            bent = 1 + distortion * np.minimum((place**2).sum(axis=1, keepdims=True) / CORNER**2, 2)
            place = ideal / bent
        return np.asarray(place + SIZE / 2)

    def depth_evidence(self) -> stationary.DepthEvidence:
        """Of what a solver makes of it that begins with the true cameras, and takes them for pinholes."""
        made = solution.empty(self.tracks, FOCAL, largest_error=30)
        made.focal[:], made.rotation[:], made.translation[:] = self.focal, self.rotation, self.translation
        solution.triangulate(made)
        bundle, seen, posed, kept = self_calibration.as_bundle(made)
        self_calibration.put_back(made, adjust(bundle, seen, 1.0).bundle, posed, kept)
        depth = stationary.depth_evidence(made)
        assert depth is not None
        print(depth, f"uncertainty {depth.uncertainty:.2f}")
        return depth


LENSES = {
    "pinhole": {}, "3 % of distortion": {"distortion": 0.03}, "20 ms of rolling shutter": {"readout": 0.48},
    "slow zoom": {"zoom": 0.1}, "all three": {"distortion": 0.03, "readout": 0.48, "zoom": 0.1},
}  # fmt: skip
EACH_LENS = pytest.mark.parametrize(
    "lens",
    [
        pytest.param(lens, id=name, marks=[] if name in ("pinhole", "all three") else pytest.mark.long)
        for name, lens in LENSES.items()
    ],
)


@EACH_LENS
def test_a_pan_through_any_lens_tells_no_depth(lens: dict[str, float]) -> None:
    # A solve of a pan has some path, or it would have no points.
    pan = Filmed(**lens)
    pan.translation = Filmed(path=0.05).translation
    assert pan.depth_evidence().gain < -0.1


@EACH_LENS
def test_one_per_cent_of_parallax_is_beyond_any_lens(lens: dict[str, float]) -> None:
    # Path over depth, from the nearest to the farthest: 1 % of the width.
    assert Filmed(path=0.013, **lens).depth_evidence().gain > 0.3


@pytest.mark.parametrize(
    ("weak", "advice"), [(None, ""), (0.3, "depth is not exact"), (1.2, "shows hardly any depth")]
)
def test_a_solve_says_how_little_depth_its_clip_tells(weak: float | None, advice: str) -> None:
    model = foreign_models.world(points=60)
    said = report(model, tuple(model.frames.tolist()), Figures(weak_depth=weak)).advice
    assert advice in said
    assert ("depth" in said) == (weak is not None)
