"""The judge's scores, each on a case worked by hand."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from addon.core.media.light import decode_srgb
from benchmarks.accuracy import metrics


def grey(value: float, height: int = 16, width: int = 16) -> np.ndarray:
    """A picture whose sRGB encoded value is `value` everywhere."""
    return np.full((height, width, 3), decode_srgb(np.array(value)), dtype=np.float32)


def encoded(values: np.ndarray) -> np.ndarray:
    """(H, W, 3) picture with these encoded values, (H, W), in all channels."""
    return np.repeat(decode_srgb(values)[..., None], 3, axis=2).astype(np.float32)


def noise(seed: int, height: int = 48, width: int = 64) -> np.ndarray:
    return np.random.default_rng(seed).random((height, width, 3), dtype=np.float32)


# PSNR


def test_psnr_of_an_even_error() -> None:
    # 0.1 everywhere: -10 log10(0.01) = 20 dB.
    assert metrics.psnr(grey(0.6), grey(0.5)) == pytest.approx(20, abs=1e-4)


def test_the_noise_of_a_truth_is_left_out() -> None:
    """An even error of 0.01, 40 dB, under noise of 0.02 in each of two renders, whose mean has 37 dB."""
    seeds = [
        decode_srgb(0.5 + 0.02 * np.random.default_rng(seed).standard_normal((180, 320, 3))).astype(
            np.float32
        )
        for seed in (1, 2)
    ]
    picture = grey(0.51, 180, 320)
    assert metrics.psnr(picture, (seeds[0] + seeds[1]) / 2) < 36
    assert metrics.unbiased_psnr(picture, (seeds[0], seeds[1])) == pytest.approx(40, abs=0.1)
    left = np.zeros((180, 320), bool)
    left[:, :160] = True
    picture[:, 160:] = 1
    assert metrics.unbiased_psnr(picture, (seeds[0], seeds[1]), left) == pytest.approx(40, abs=0.15)
    assert math.isnan(metrics.unbiased_psnr(picture, (seeds[0], seeds[1]), np.zeros((180, 320), bool)))


def test_another_size_is_refused() -> None:
    for score in (metrics.psnr, metrics.ssim, metrics.flip):
        with pytest.raises(ValueError, match="truth"):
            score(grey(0.5, 16, 20), grey(0.5, 20, 16))


# SSIM


def test_ssim_is_the_paper_s() -> None:
    """Wang et al. 2004, equations 13 to 16, written out with OpenCV's Gaussian window."""
    a, b = noise(1), np.clip(noise(1) + 0.4 * noise(2) - 0.2, 0, 1)
    x, y = (metrics._encoded(p, p) for p in (a, b))

    def mean(values: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(values, (11, 11), 1.5)

    var_x, var_y = mean(x * x) - mean(x) ** 2, mean(y * y) - mean(y) ** 2
    covariance = mean(x * y) - mean(x) * mean(y)
    luminance = (2 * mean(x) * mean(y) + 1e-4) / (mean(x) ** 2 + mean(y) ** 2 + 1e-4)
    structure = (2 * covariance + 9e-4) / (var_x + var_y + 9e-4)
    # Whole windows only: the border is not part of the mean.
    expected = (luminance * structure)[5:-5, 5:-5].mean()
    assert metrics.ssim(a, b) == pytest.approx(expected, abs=1e-6)


# FLIP: Andersson et al. 2020. An even difference has no features, so it is the colour term alone: with
# d = HyAB^0.7 in Hunt-adjusted L*a*b*, d / (0.4 c) * 0.95 up to 0.4 c, then on linearly to 1 at c. c is d
# between green and blue: L*a*b* (87.73, -86.18, 83.18) and (32.30, 79.19, -107.86), Hunt-adjusted by
# L* / 100, are 55.43 + 147.9 = 203.3 apart, so c = 41.28.


def flat(*rgb: float) -> np.ndarray:
    return np.broadcast_to(np.array(rgb, dtype=np.float32), (32, 32, 3)).copy()


def test_flip_of_green_and_blue_is_one() -> None:
    # The two colours that are farthest apart: also, no other pair of primaries gives 1.
    assert metrics.flip(flat(0, 1, 0), flat(0, 0, 1)) == pytest.approx(1, abs=1e-6)
    assert metrics.flip(flat(0, 1, 0), flat(1, 0, 0)) < 0.999


def test_flip_takes_the_picture_for_linear_light() -> None:
    # 18 % light is L* 49.50: 49.50^0.7 = 15.35, 0.95 * 15.35 / 16.51 = 0.883. Taken for sRGB, L* is 18.8 and
    # the score 0.45.
    assert metrics.flip(flat(0.18, 0.18, 0.18), flat(0, 0, 0)) == pytest.approx(0.883, abs=2e-3)


# The band around depth jumps


def test_the_face_of_a_ball_has_no_band_but_its_outline_has() -> None:
    # A ball of radius 1 at depth 5 before a wall at 8, f = 100.
    y, x = (np.mgrid[0:96, 0:96] - 47.5) / 100
    square = x**2 + y**2 + 1
    root = 25 - 24 * square
    inverse = np.where(root > 0, square / (5 - np.sqrt(np.maximum(root, 0))), 1 / 8)
    band = metrics.edge_band(inverse)
    from_outline = np.abs(100 * np.hypot(x, y) - 100 / np.sqrt(24))
    assert band[from_outline < 6].all()
    assert not band[from_outline > 9].any()


@pytest.mark.parametrize("width", [3, 15])
def test_a_step_has_a_band_of_that_width_on_its_nearer_pixel(width: int) -> None:
    step = np.full((40, 60), 0.1)
    step[:, 30:] = 0.2
    expected = np.abs(np.arange(60) - 30) <= width // 2
    assert np.array_equal(metrics.edge_band(step, width), np.tile(expected, (40, 1)))
    # The other way round the nearer pixel is the one before.
    assert np.array_equal(metrics.edge_band(step[:, ::-1], width), np.tile(expected[::-1], (40, 1)))
    assert np.array_equal(metrics.edge_band(step.T, width), np.tile(expected[:, None], (1, 40)))


def test_in_focus_is_under_half_a_pixel_either_way() -> None:
    disc = np.array([[-0.6, -0.5, -0.49, 0.0, 0.49, 0.5, 30.0]])
    assert metrics.in_focus(disc).tolist() == [[False, False, True, True, True, False, False]]


# Time


def test_rm_of_flicker_and_of_a_steady_error() -> None:
    truths = [grey(0.4), grey(0.5), grey(0.2)]
    # Errors 0.1, 0.3, 0.0: the changes are 0.2 and 0.3.
    assert metrics.rm([grey(0.5), grey(0.8), grey(0.2)], truths) == pytest.approx(0.25, abs=1e-6)
    assert metrics.rm([grey(0.5), grey(0.6), grey(0.3)], truths) == pytest.approx(0, abs=1e-6)
    assert metrics.rm(truths, truths) == 0


def spot(column: int) -> np.ndarray:
    """An error of 0.4 in one pixel of row 2, on black."""
    values = np.zeros((5, 10))
    values[2, column] = 0.4
    return encoded(values)


BLACK = encoded(np.zeros((5, 10)))
ALL = np.ones((5, 10), dtype=bool)


def test_an_error_that_moves_with_the_scene_costs_nothing() -> None:
    motion = np.zeros((5, 10, 2))
    motion[..., 0] = 3
    clip = [spot(1), spot(4), spot(7)]
    assert metrics.warped_error(clip, [BLACK] * 3, [motion] * 2, [ALL] * 2) == pytest.approx(0, abs=1e-7)
    # Without the motion, two pixels of 50 change by 0.4 each time.
    still = np.zeros((5, 10, 2))
    assert metrics.warped_error(clip, [BLACK] * 3, [still] * 2, [ALL] * 2) == pytest.approx(0.016, abs=1e-6)


# The truth's own noise


def test_the_mean_of_two_seeds_is_6_db_over_the_ceiling() -> None:
    rng = np.random.default_rng(7)
    clean = np.full((200, 200), 0.5)
    seeds = [clean + rng.normal(0, 0.01, clean.shape) for _ in range(2)]
    one, other, mean = (encoded(values) for values in (*seeds, (seeds[0] + seeds[1]) / 2))
    ceiling = metrics.noise_ceiling(one, other)
    # The two differ by 0.01 sqrt(2): 36.99 dB. 40,000 values leave 0.03 dB of chance.
    assert ceiling == pytest.approx(36.99, abs=0.15)
    assert metrics.psnr(mean, encoded(clean)) == pytest.approx(ceiling + 6.02, abs=0.2)


def test_a_claim_near_the_ceiling_is_marked() -> None:
    assert not metrics.within_noise(34.0, 40.0)
    assert metrics.within_noise(34.1, 40.0)
    assert metrics.within_noise(55.0, 40.0)
    assert metrics.within_noise(math.inf, 40.0)
    assert not metrics.within_noise(60.0, math.inf)
    assert not metrics.within_noise(math.nan, 40.0)
