"""What a lens and a shutter do to a picture, against finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from addon.core.sfm.adjustment.bundle import Distortion


def test_derivatives_agree_with_finite_differences() -> None:
    rng = np.random.default_rng(0)
    frame = rng.integers(0, 4, 50).astype(np.int32)
    xy = rng.uniform(-300, 300, (50, 2))
    point = np.column_stack([xy / 500, np.ones(50)]) * rng.uniform(2, 8, (50, 1))
    focal = np.full(50, 500.0)
    lens = Distortion((640, 330), rng.normal(0, 0.02, (4, 3)), np.array([0.01, -0.02, -0.1, 0.03, 0.1, 0.5]))

    def places(at: Distortion, local: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> object:
        return at.bent(focal[:, None] * local[:, :2] / local[:, 2:])

    local = lens.turned(point, frame, xy)
    by_place, by_parameters = lens.derivatives(local, focal, frame, xy)
    for number in range(6):
        step = 1e-6 * np.eye(6)[number]
        ends = [replace(lens, parameters=lens.parameters + sign * step) for sign in (1, -1)]
        after, before = (np.asarray(places(each, each.turned(point, frame, xy))) for each in ends)
        slope = (after - before) / 2e-6
        assert np.allclose(by_parameters[..., number], slope, rtol=0.002, atol=0.005), number
    for number in range(2):
        step = np.zeros(3)
        step[number] = 1e-6
        after, before = (np.asarray(places(lens, local + sign * local[:, 2:] * step)) for sign in (1, -1))
        slope = (after - before) / (2e-6 * focal[:, None])
        assert np.allclose(by_place[..., number], slope, atol=1e-6)
