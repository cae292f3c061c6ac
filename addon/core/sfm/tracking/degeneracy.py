"""Checks before solving: motion of the camera, and parallax."""

from itertools import pairwise

import numpy as np

from ...base.arrays import Floats
from ...base.errors import Remedy, UserError
from ...media.clip import MOST_STILLS
from .tracks import Tracks, cuts

PHOTOS = 3
"""Pictures a cut or fewer are photos rather than a clip of several shots: kermit (real data) has 11 pictures,
and 5 times the tracker is lost. Chosen by inspection."""
FINE = 64
"""Parts of a clip between whose ends a fast scroll is looked for: its tracks soon leave the picture."""
MIN_SHARED = 40
"""Tracks that two frames must share to be compared, and whose depths can be. Chosen by inspection."""
MIN_MOTION = 0.3
"""Median motion of tracks (px of 1,000); less is a still camera. Chosen by inspection."""
STILL = 2.0
"""Motion in pixels of a 1,000-pixel frame up to which a track stands still, as a page's header does."""
SCROLLED = 50.0
"""Median motion of the other tracks, in the same pixels, to compare them: noise is below 1 % of it."""
ALIKE = 0.01
"""Share of the median motion by which a tenth of the tracks may move otherwise. Scrolling pages, also in
H.264, have up to 0.007; seven real clips 0.03 (a pan over distant roofs) to 5."""
FOCALS = (0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0, 3.0)
"""Focal lengths, in long sides of the frame, with which a pure rotation is tried."""


class StaysError(UserError):
    """The camera of a clip stays in its place, so that its pictures have no depth."""


def check_motion(tracks: Tracks) -> float:
    """Pixels (of a frame 1,000 pixels long) that stay unexplained by the best pure rotation.

    A pan, even with a perfect reprojection error, has one depth for all points (a "confident fake"), and
    neither the reprojection error nor the triangulation angle shows it.

    Raises:
        UserError: The clip has too few features, the camera stands still, or the picture only slides. Cameras
            that only turn are refused later, by `only_turns`.
    """
    shared = _shared(tracks, 8)
    if not shared:
        raise UserError(
            f"fewer than {MIN_SHARED} features can be followed through the clip; it has too little"
            " texture or is blurred: choose another range of frames",
            Remedy.FRAMES,
        )
    unit = 1000 / max(tracks.width, tracks.height)
    motion = max(float(np.median(np.linalg.norm(b - a, axis=1))) for a, b in shared) * unit
    if motion < MIN_MOTION:
        raise StaysError(
            "the camera does not move in this clip; depth needs a camera that moves sideways a little, or"
            " depth maps of the clip",
            Remedy.DEPTH_MAPS,
        )
    if _only_slides(tracks):
        raise StaysError(
            "everything that moves in this clip moves alike, as on a page that scrolls: a flat or distant"
            " picture shows no depth; film near and far things with a camera that moves sideways, or solve"
            " it with depth maps",
            Remedy.DEPTH_MAPS,
        )
    residuals = [min(rotation_residual(a, b, tracks, focal) for focal in FOCALS) for a, b in shared]
    return max(residuals) * unit


def refuse_cuts(tracks: Tracks) -> None:
    """Check that a clip has no cuts; UserError, which lists the shots, if it has."""
    starts = [0, *cuts(tracks), len(tracks.frames)]
    if len(starts) > 2 and len(tracks.frames) <= PHOTOS * (len(starts) - 2):
        raise UserError(
            f"{len(starts) - 2} of {len(tracks.frames)} images share nothing with the one before, so this"
            f" is not a clip; up to {MOST_STILLS} unordered photos can be solved as stills",
            Remedy.STILLS,
        )
    if len(starts) > 2:
        shots = [f"{tracks.frames[a]}-{tracks.frames[b - 1]}" for a, b in pairwise(starts)]
        raise UserError(
            f"the clip has {len(shots) - 1} cut{'s' * (len(shots) > 2)}; solve each shot separately; their"
            f" frames: {', '.join(shots)}",
            Remedy.FRAMES,
        )


def only_turns(measured: str) -> StaysError:
    """Return the refusal of a clip that agrees with a turning camera, with its measure."""
    return StaysError(
        f"the camera only turns in this clip ({measured}): too little parallax; move the camera sideways"
        " while filming, or solve it with depth maps",
        Remedy.DEPTH_MAPS,
    )


def rotation_residual(a: Floats, b: Floats, tracks: Tracks, focal: float) -> float:
    """Return the median distance in pixels of places b (n, 2) from rotated places a (n, 2).

    The rotation is the best one, refined twice with the half that fits best.
    """
    centre = np.array([tracks.width, tracks.height]) / 2
    length = focal * max(tracks.width, tracks.height)
    rays_a, rays_b = (unit_rays((xy - centre) / length) for xy in (a, b))
    keep = np.ones(len(a), bool)
    error = np.zeros(len(a))
    for _ in range(3):
        turned = rays_a @ kabsch(rays_a[keep], rays_b[keep]).T
        error = np.linalg.norm(turned[:, :2] / turned[:, 2:] * length + centre - b, axis=1)
        keep = error <= np.median(error) + 1e-12
    return float(np.median(error))


def kabsch(a: Floats, b: Floats) -> Floats:
    """Return (3, 3) rotation that brings unit rays (n, 3) a closest to b.

    Kabsch, "A solution for the best rotation to relate two sets of vectors", 1976.
    """
    u, _, vt = np.linalg.svd(b.T @ a)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt)


def _only_slides(tracks: Tracks) -> bool:
    """Whether all moving tracks have one motion, between any two frames in which they move far enough."""
    unit = 1000 / max(tracks.width, tracks.height)
    judged = False
    for a, b in _shared(tracks, FINE):
        flow = (b - a) * unit
        flow = flow[np.linalg.norm(flow, axis=1) > STILL]
        if len(flow) < MIN_SHARED:
            continue
        common = np.median(flow, axis=0)
        motion = float(np.linalg.norm(common))
        if motion < SCROLLED:
            continue
        judged = True
        if np.percentile(np.linalg.norm(flow - common, axis=1), 90) > ALIKE * motion:
            return False
    return judged


def _shared(tracks: Tracks, parts: int) -> list[tuple[Floats, Floats]]:
    """Places (n, 2) and (n, 2) of the tracks shared by `pairs`, of those that share enough."""
    both = (tracks.shared(i, j) for i, j in pairs(tracks, parts))
    return [pair for pair in both if len(pair[0]) >= MIN_SHARED]


def pairs(tracks: Tracks, parts: int) -> list[tuple[int, int]]:
    """Return indices of the ends of a clip, of its halves, quarters, ... up to so many parts."""
    last = len(tracks.frames) - 1
    powers = range(parts.bit_length())
    cuts = [np.linspace(0, last, 2**power + 1).round().astype(int) for power in powers]
    return sorted({(int(i), int(j)) for c in cuts for i, j in pairwise(c) if j > i})


def unit_rays(xy: Floats) -> Floats:
    """Return unit rays (n, 3) through normalised places (n, 2) of a pinhole."""
    rays = np.column_stack([xy, np.ones(len(xy))])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))
