"""What is clipped gets its light back: as much as was lost, nowhere else, the same in every frame."""

from __future__ import annotations

import itertools

import cv2
import numpy as np
import pytest

from addon.core.base.arrays import Floats, LinearRGB, Map
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.frame.clip_context import ClipContext, no_picture
from addon.core.frame.highlights import RESTORED, HighlightSettings
from addon.core.media.light import decode_srgb, encode_srgb, to_linear
from addon.core.media.picture_file import Pixels
from addon.core.warp.clipped_blobs import clipped_blobs, point_spread

SIZE = 320, 180
FINER = 8
GREY = np.full(3, 0.05)
WARM = np.array([1.0, 0.6, 0.25])
THRESHOLD = RESTORED.threshold
FRAMES = 24


def painted(place: Floats, radius: float, light: Floats, ground: Floats = GREY) -> LinearRGB:
    """(H, W, 3) what a camera sees before it clips: a disc of linear light (3,) on a ground (3,), through a
    pixel's square and optics of 0.3 pixels."""
    wide = np.zeros((FINER * SIZE[1], FINER * SIZE[0]), np.float32)
    fixed = np.round(16 * (FINER * place - 0.5)).astype(int)
    cv2.circle(wide, (int(fixed[0]), int(fixed[1])), round(16 * FINER * radius), 1.0, -1, shift=4)
    share = cv2.resize(cv2.GaussianBlur(wide, (0, 0), 0.3 * FINER), SIZE, interpolation=cv2.INTER_AREA)
    return np.asarray(ground + share[..., None] * (light - ground), np.float32)


def recorded(light: LinearRGB, seed: int = 0) -> Pixels:
    """(H, W, 3) the 8 bits that a camera makes of it, with a step of noise."""
    noise = np.random.default_rng(seed).standard_normal(light.shape)
    return np.clip(np.rint(255 * encode_srgb(np.clip(light, 0, 1)) + noise), 0, 255).astype(np.uint8)


def alone() -> Reconstruction:
    return sideways(1)


def sideways(count: int) -> Reconstruction:
    """Cameras that go to the right, 0.01 a frame."""
    camera = Intrinsics(*SIZE, 300.0, 300.0, SIZE[0] / 2, SIZE[1] / 2)
    nothing = np.zeros((0, 2)), np.zeros(0, np.int32)
    images = tuple(Image(n + 1, np.eye(3), np.array([-0.01 * n, 0.0, 0.0]), *nothing) for n in range(count))
    return Reconstruction(
        (camera,), images, Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))
    )


def restored(stored: Pixels, settings: HighlightSettings = RESTORED) -> Map:
    """(H, W, 3) of a clip of one frame."""
    return ClipContext(alone(), lambda frame: stored).picture(1, settings)[..., :3]


def over_ground(picture: Map) -> float:
    """Energy of the first channel over the ground."""
    return float((picture[..., 0] - GREY[0]).sum(dtype=np.float64))


@pytest.mark.parametrize("radius", [1.5, 2.2, 3.0])
@pytest.mark.parametrize(("radiance", "least", "most"), [(2, 0.8, 1.25), (6, 0.6, 1.5), (20, 0.35, 1.5)])
def test_a_lamp_gets_its_energy(radius: float, radiance: float, least: float, most: float) -> None:
    light = painted(np.array([100.3, 80.6]), radius, radiance * WARM)
    stored = recorded(light)
    share = over_ground(restored(stored)) / over_ground(light)
    print(f"radius {radius}: {over_ground(to_linear(stored)) / over_ground(light):.2f} to {share:.2f}")
    assert least < share < most


@pytest.mark.parametrize("radiance", [60.0, 200.0])
def test_a_very_bright_lamp_is_not_made_too_bright(radiance: float) -> None:
    light = painted(np.array([100.3, 80.6]), 3.0, radiance * WARM)
    stored = recorded(light)
    found = over_ground(restored(stored))
    assert 3 * over_ground(to_linear(stored)) < found < 1.5 * over_ground(light)


def enlarged(scene: Map, times: int, optics: float, grain: float = 0.0) -> LinearRGB:
    """(H, W, 3) of a scene (finer H, finer W, c) in a picture of `times` `SIZE`, through optics in pixels."""
    finer = scene.shape[1] // (times * SIZE[0])
    size = times * SIZE[0], times * SIZE[1]
    light = cv2.resize(cv2.GaussianBlur(scene, (0, 0), optics * finer), size, interpolation=cv2.INTER_AREA)
    noise = np.random.default_rng(2).standard_normal((*light.shape[:2], 1))
    return np.asarray(light.reshape(*light.shape[:2], -1) * (1 + grain * noise) * np.ones(3), np.float32)


def lamps_at_night() -> Map:
    """24 lamps of 6 times white on black, and a chart of unclipped squares, 12 samples a pixel of `SIZE`."""
    rng, wide = np.random.default_rng(0), np.full((12 * SIZE[1], 12 * SIZE[0], 3), 0.05, np.float32)
    wide[1800:2088, 2760:3720] = np.kron(0.8 * rng.random((6, 20, 1)), np.ones((48, 48, 1)))
    for n in range(24):
        x, y = 12 * (np.array([25 + 45 * (n % 7), 20 + 35 * (n // 7)]) + rng.uniform(-5, 5, 2))
        cv2.circle(wide, (round(x), round(y)), round(12 * rng.uniform(1.2, 3)), (6.0, 3.6, 1.5), -1)
    return wide


@pytest.mark.parametrize("optics", [0.3, 0.9])
def test_lamps_get_as_much_light_in_a_picture_three_times_as_large(optics: float) -> None:
    """By a larger sensor, and as an enlargement, whose point spread is three times as wide."""
    scene, shares = lamps_at_night(), []
    for times, spread in ((1, 0.3), (3, optics)):
        light = enlarged(scene, times, spread)
        shares.append(over_ground(restored(recorded(light))) / over_ground(light))
    print(f"{shares[0]:.3f} and {shares[1]:.3f}")
    assert shares[1] == pytest.approx(shares[0], rel=0.1)


@pytest.mark.parametrize(("times", "optics"), [(1, 0.3), (3, 0.3), (3, 0.9), (6, 0.3)])
def test_a_printed_sheet_that_grain_clips_in_part_stays_as_it_is(times: int, optics: float) -> None:
    rng, wide = np.random.default_rng(5), np.full((24 * SIZE[1], 24 * SIZE[0]), 0.25, np.float32)
    wide[1440:2400, 3360:4080] = 1.0
    for top, left in itertools.product(range(1512, 2328, 72), (3408, 3744)):
        for x in range(left, left + 240, 48):
            wide[top : top + 29, x : x + int(rng.integers(12, 40))] = 0.15
    # As soft as print.
    wide = cv2.GaussianBlur(wide, (0, 0), 3.6)
    stored = recorded(enlarged(wide, times, optics, grain=0.03))
    before = to_linear(stored)[..., :3]
    assert (before >= THRESHOLD).mean() > 0.003
    np.testing.assert_array_equal(restored(stored), before)


def test_only_clipped_channels_of_clipped_pixels_change() -> None:
    stored = recorded(painted(np.array([100.3, 80.6]), 3.0, np.array([6.0, 0.7, 0.2])))
    before, after = to_linear(stored)[..., :3], restored(stored)
    changed = after != before
    assert changed.any()
    assert (before[changed] >= THRESHOLD).all()
    assert (after >= before).all()
    assert not changed[..., 1:].any()


def test_a_lamp_has_the_colour_of_its_rim() -> None:
    stored = recorded(painted(np.array([100.3, 80.6]), 3.0, 12 * WARM))
    middle = restored(stored)[80, 100]
    np.testing.assert_allclose(middle / middle[0], WARM, atol=0.1)


@pytest.mark.parametrize("shape", ["sky", "window", "wall with a hole", "sky between leaves"])
def test_large_clipped_areas_stay_as_they_are(shape: str) -> None:
    light = np.full((SIZE[1], SIZE[0], 3), 0.1, np.float32)
    if shape == "sky":
        light[:60] = 3.0
    elif shape == "window":
        light[50:90, 100:140] = 3.0
    elif shape == "wall with a hole":
        light[20:160, 40:280] = 3.0
        light[60:64, 100:104] = 0.1
    else:
        light[:60] = 3.0
        light[50:60, ::3] = 0.1
    stored = recorded(light)
    np.testing.assert_array_equal(restored(stored), to_linear(stored)[..., :3])


def test_paint_that_is_nearly_white_stays_as_it_is() -> None:
    rng = np.random.default_rng(1)
    light = np.full((SIZE[1], SIZE[0], 3), 0.6, np.float32)
    light[40:140, 60:260] += 0.4 * rng.random((100, 200, 1), np.float32)
    stored = recorded(light)
    before = to_linear(stored)[..., :3]
    assert (before >= THRESHOLD).any()
    assert restored(stored).sum() < 1.001 * before.sum()


def test_a_lamp_becomes_a_window_without_a_jump() -> None:
    weights = []
    for radius in np.arange(2.5, 7.5, 0.125):
        light = painted(np.array([100.3, 80.6]), radius, np.full(3, 6.0))
        found = clipped_blobs(to_linear(recorded(light)), THRESHOLD)
        weights.append(found.weight[0] if len(found) else 0.0)
    assert weights[0] == 1
    assert weights[-1] == 0
    assert np.abs(np.diff(weights)).max() < 0.3


def test_a_lamp_is_as_bright_in_every_frame() -> None:
    """It moves over the pixels by fractions of them, and nearer lamps farther."""
    cameras = sideways(FRAMES)
    lamps = ((np.array([90.2, 60.4]), 2.0), (np.array([150.7, 100.1]), 6.0), (np.array([220.3, 70.9]), 3.0))
    frames, own = {}, {}
    for frame in range(1, FRAMES + 1):
        light = np.tile(GREY.astype(np.float32), (SIZE[1], SIZE[0], 1))
        for place, parallax in lamps:
            shifted = place - [parallax * 0.17 * (frame - 1), 0]
            light = np.maximum(light, painted(shifted, 2.5, 6 * WARM))
        frames[frame] = recorded(light, frame)
        own[frame] = light
    clip = ClipContext(cameras, frames.__getitem__)
    together = [over_ground(clip.picture(n, RESTORED)[..., :3]) / over_ground(own[n]) for n in frames]
    single = [over_ground(restored(frames[n])) / over_ground(own[n]) for n in frames]
    print(f"alone {np.std(np.log(single)):.3f}, together {np.std(np.log(together)):.3f}")
    assert np.std(np.log(together)) < 0.75 * np.std(np.log(single))
    assert np.abs(np.diff(np.log(together))).max() < np.abs(np.diff(np.log(single))).max()


def test_floats_hold_what_is_over_white_already() -> None:
    light = painted(np.array([100.3, 80.6]), 3.0, 12 * WARM)
    np.testing.assert_array_equal(restored(light), light)
    np.testing.assert_array_equal(restored(np.minimum(light, 1)), np.minimum(light, 1))


def test_a_clip_that_clips_under_white_takes_a_lower_threshold() -> None:
    light = np.minimum(painted(np.array([100.3, 80.6]), 3.0, np.full(3, 12.0)), 0.8)
    stored = recorded(light)
    np.testing.assert_array_equal(restored(stored), to_linear(stored)[..., :3])
    low = restored(stored, HighlightSettings(threshold=0.75))
    assert low.max() > 3


@pytest.mark.parametrize("spread", [0.42, 1.0])
def test_sharp_edges_tell_the_point_spread(spread: float) -> None:
    rng = np.random.default_rng(3)
    wide = cv2.resize(rng.random((15, 20), np.float32), (1600, 1200), interpolation=cv2.INTER_NEAREST)
    optics = FINER * np.sqrt(spread**2 - 1 / 12)
    picture = cv2.resize(cv2.GaussianBlur(wide, (0, 0), optics), (200, 150), interpolation=cv2.INTER_AREA)
    assert point_spread(np.repeat(0.85 * picture[..., None], 3, axis=2)) == pytest.approx(spread, rel=0.2)


def test_a_picture_without_clipped_pixels_has_no_highlights() -> None:
    picture = to_linear(recorded(painted(np.array([100.3, 80.6]), 3.0, 0.9 * WARM)))
    assert not len(clipped_blobs(picture, THRESHOLD))
    # Nor are other frames read for it.
    clip = ClipContext(
        sideways(3), lambda frame: recorded(0 * picture[..., :3]) if frame == 2 else no_picture(frame)
    )
    np.testing.assert_array_equal(
        clip.picture(2, RESTORED)[..., :3],
        decode_srgb(recorded(0 * picture[..., :3]) / 255).astype(np.float32),
    )
