"""Positions of the virtual cameras on the virtual aperture, how many are needed, and their registration."""

from functools import lru_cache

import numpy as np

from ..base.arrays import Floats
from ..base.errors import UserError
from ..camera.canvas import Canvas

MIN_VIEWS, MAX_VIEWS = 16, 512
"""Bounds of the automatic number of views: fewer show as copies of highlights, more look alike. Chosen by
inspection."""
LEAST_PREFILTERED = 8
"""Least automatic number for a prefiltered texture, which shows no copies. Chosen by inspection."""
MOST_VIEWS = 4096
"""Most views that a user can set: eight times the number from which results look alike. Chosen by
inspection."""
MOST_RELAXED = 128
"""Positions up to which they are relaxed to the end, in at most a second."""
RELAXATIONS = 60
"""Iterations of Lloyd's algorithm. Three times as many change the error of 4 to 48 positions by less than 0.1
dB, with all spatial frequencies weighted alike."""
FEW_RELAXATIONS = 8
"""Iterations for more positions, up to `MAX_VIEWS`: 256 positions blur highlights with 52.4 dB, 51.0 after
four iterations, 43.7 on Vogel's spiral (`tests/render/test_aperture_shapes.py`)."""
SAMPLES = 8192
"""Samples of the disc for centroids: at least 64 a share."""


def random_disc(count: int, seed: int) -> Floats:
    """Return independent, uniformly random positions (count, 2) on the unit disc.

    The thesis's section 3.5.
    """
    check_count(count)
    rng = np.random.default_rng(seed)
    radius = np.sqrt(rng.random(count))
    angle = 2 * np.pi * rng.random(count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def vogel_disc(count: int) -> Floats:
    """Return (count, 2) Vogel spiral on the unit disc, recentred to a mean of exactly zero.

    Vogel, "A better way to construct the sunflower head", 1979. At equal error it needs 4 to 8 times
    fewer positions than random ones; the same positions on every frame, so that nothing flickers.
    """
    check_count(count)
    index = np.arange(count)
    radius = np.sqrt((index + 0.5) / count)
    angle = index * np.pi * (3 - np.sqrt(5))
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return np.asarray(disc - disc.mean(axis=0))


@lru_cache
def centroidal_disc(count: int) -> Floats:
    """Return positions (count, 2) on the unit disc, each the centroid of an equal share.

    They are Vogel's spiral after `relaxed`, with a mean of exactly zero; more than `MAX_VIEWS` are the spiral
    itself. The variance of the positions and the variance within shares add up to the disc's. Blurred by a
    disc of the size of a share, they have the disc's own blur. Read-only.
    """
    disc = vogel_disc(count)
    if count <= MAX_VIEWS:
        disc, _ = relaxed(disc, vogel_disc(SAMPLES), np.ones(SAMPLES), np.pi)
        disc = disc - disc.mean(axis=0)
    disc.flags.writeable = False
    return disc


def relaxed(positions: Floats, places: Floats, light: Floats, area: float) -> tuple[Floats, Floats]:
    """Move positions (N, 2) to the centroids of equal shares of the light (n,) at samples (n, 2) of an area.

    Lloyd's iteration with the cells of a power diagram (de Goes, Breeden, Ostromoukhov and Desbrun, "Blue
    noise through optimal transport", 2012), to the end for up to `MOST_RELAXED` positions. `area` is in
    squared radii.

    Returns:
        Positions (N, 2), and the light (N,) of their shares.
    """
    count = len(positions)
    weight, mass = np.zeros(count), np.zeros(count)
    for _ in range(RELAXATIONS if count <= MOST_RELAXED else FEW_RELAXATIONS):
        # |s - p|^2 without the place's own part, which is the same for all positions.
        share = ((positions**2).sum(axis=1) - weight - 2 * places @ positions.T).argmin(axis=1)
        held, mass = np.bincount(share, minlength=count), np.bincount(share, light, minlength=count)
        sums = np.stack([np.bincount(share, light * axis, minlength=count) for axis in places.T], axis=1)
        positions = np.where(mass[:, None] > 0, sums / np.maximum(mass, 1e-12)[:, None], positions)
        weight += area / np.pi * (1 / count - held / len(places))
    return positions, mass


def views_needed(blur: float, prefiltered: bool) -> int:
    """Return the number of views for a frame, by its largest blur disc.

    Plain views show a step edge with about 45 dB, fitted to measured 45, 80 and 130 views at 16, 32 and 64
    pixels. With a prefiltered texture 14, 20 and 30 have the same error, PSNR and edges, in the mean over
    bars, fence and walk of `python -m benchmarks.timings.view_error`.

    Args:
        blur: Diameter of the disc in pixels.
        prefiltered: True if the texture is blurred for the views.

    Raises:
        UserError: The disc is infinitely large.
    """
    if not np.isfinite(blur):
        raise UserError("the blur disc is infinitely large; choose a smaller aperture")
    first, growth, least = (14, 0.55, LEAST_PREFILTERED) if prefiltered else (45, 0.77, MIN_VIEWS)
    return int(np.clip(np.ceil(first * (max(blur, 0.0) / 16) ** growth), least, MAX_VIEWS))


def check_count(count: int) -> None:
    """Check a number of positions; UserError if it is out of range."""
    if count < 1:
        raise UserError(f"the number of views is {count}; it must be at least 1")


def exact_registration(canvas: Canvas, offsets: Floats, inverse_depth: float) -> Floats:
    """Return the shears (N, 2, 3) that bring a plane of an inverse depth into register for offsets (N, 2).

    A point moves by -f (dx, dy) / z when the camera moves by (dx, dy) in scene units; the shear adds the
    focal plane's motion back, which in Blender is `shift_x`, `shift_y`.
    """
    registration = np.zeros((len(offsets), 2, 3))
    registration[:, 0, 0] = registration[:, 1, 1] = 1.0
    registration[:, :, 2] = canvas.pinhole.focal * offsets * inverse_depth
    return registration
