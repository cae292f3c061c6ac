"""Leave people out of a clip's tracks, so that cameras are found from the static scene alone."""

from collections.abc import Callable

import cv2
import numpy as np

from ...base.arrays import Bytes, Mask
from ...media.clip import Footage
from ...subjects.networks import Networks
from ...subjects.people import SEEN_IN, bodies, face_of, people, sampled
from ...subjects.pictures import displayed, small
from ...subjects.segmenter import Segmenter, stands_out
from ..steps import progress
from .degeneracy import pairs
from .tracks import Tracks

MARGIN = 0.01
"""Width by which people are enlarged, as a share of the long side: corners on an outline move with it."""
INSIDE = 0.5
"""Share of a track's observations that lie on people, from which on the track is theirs."""
LOOKS = 24
"""Frames in which people are looked for; tracks are compared with the nearest of them. People carried through
all frames cost four to ten times as much on clips of 40 to 170 frames, for nearly the same tracks."""

PARTS = 8
"""Parts of a clip between whose ends people's motion is looked for, besides larger ones."""
LEAST = 8
"""Tracks that two frames must share on people and beside them to be compared."""
ALIVE, WITH_FACE = 1.0, 0.5
"""Motion of a tenth of the tracks on people against all that is still, in pixels of a 1,000-pixel frame, from
which on these are alive, and the same where a face is seen."""


def without_people(tracks: Tracks, footage: Footage, networks: Networks | None = None) -> Tracks | None:
    """Return the tracks that are not on people or on a segmenter's salient object, if these are subjects.

    Args:
        tracks: Those of the clip.
        footage: The clip.
        networks: Those that recognise people, and maybe a segmenter.

    Returns:
        Tracks with the same numbers, without the observations of the tracks on subjects; None where the
            networks are missing, or find none, or only figures that move as one with the scene: a mannequin,
            or a picture that is repeated.

    Raises:
        UserError: A frame cannot be read.
    """
    networks = networks or Networks()
    if not networks.exist:
        return None
    asked, masks, showing = sampled(footage.frames), dict[int, Mask](), 0
    looks, has_face = sorted({*sampled(footage.frames, LOOKS), *asked}), False
    pictures = dict[int, Bytes]()
    for done, frame in enumerate(looks):
        progress("Looking for people", done, len(looks))
        stored = footage.read(frame)
        picture = pictures[frame] = small(stored)
        found = people(networks, picture) if frame in asked else []
        showing += bool(found)
        has_face = has_face or any(
            face_of(networks, displayed(stored), each.mask) is not None for each in found
        )
        shares = bodies(networks, picture)
        masks[frame] = np.max([np.zeros(picture.shape[:2]), *shares], axis=0) > 0.5
    outlines = {} if networks.segmenter is None else _outlines(networks.segmenter, pictures, asked)
    if showing < min(SEEN_IN, len(asked)) and not outlines:
        return None
    for frame, outline in outlines.items():
        masks[frame] |= outline
    left = outside(tracks, lambda frame: masks[min(masks, key=lambda each: abs(each - frame))])
    return left if own_motion(tracks, left) >= (WITH_FACE if has_face else ALIVE) else None


def _outlines(segmenter: Segmenter, pictures: dict[int, Bytes], asked: list[int]) -> dict[int, Mask]:
    """Masks (h, w) of the salient object, by frame; none without one in half of the frames asked for."""
    seen = {frame: segmenter.probability(pictures[frame]) for frame in asked}
    if 2 * sum(map(stands_out, seen.values())) < len(asked):
        return {}
    seen |= {frame: segmenter.probability(pictures[frame]) for frame in pictures if frame not in seen}
    return {frame: share > 0.5 for frame, share in seen.items()}


def own_motion(tracks: Tracks, rest: Tracks) -> float:
    """Return how far people move against what is still, in pixels of a 1,000-pixel frame.

    A homography explains what is still before a camera that stays in its place. The result is the largest
    90th percentile over pairs of frames, infinite if none can be compared.

    Args:
        tracks: Those of a clip.
        rest: Those of them that are not on people.
    """
    own = tracks.only(~np.isin(tracks.track, rest.track))
    moved = list[float]()
    for i, j in pairs(tracks, PARTS):
        a, b = rest.shared(i, j)
        on_a, on_b = own.shared(i, j)
        if min(len(a), len(on_a)) < LEAST:
            continue
        cv2.setRNGSeed(0)
        still, _ = cv2.findHomography(a, b, cv2.RANSAC, 3.0)
        if still is not None:
            off = np.linalg.norm(cv2.perspectiveTransform(on_a[None], still)[0] - on_b, axis=1)
            moved.append(float(np.percentile(off, 90)))
    return max(moved, default=np.inf) * 1000 / max(tracks.width, tracks.height)


def outside(tracks: Tracks, mask: Callable[[int], Mask]) -> Tracks:
    """Return the tracks that lie outside of masks in most of their frames.

    Args:
        tracks: Those of a clip.
        mask: Returns the mask (h, w), of any size, over a frame.

    Returns:
        Tracks with the same numbers, without the observations of those inside.
    """
    size = np.array([tracks.width, tracks.height])
    inside = np.zeros(len(tracks.xy), bool)
    for index, frame in enumerate(tracks.frames):
        rows = slice(*np.searchsorted(tracks.frame_index, [index, index + 1]))
        masked = mask(frame).astype(np.uint8)
        side = 2 * max(round(MARGIN * max(masked.shape)), 1) + 1
        masked = cv2.dilate(masked, np.ones((side, side), np.uint8)) > 0
        shape = np.array(masked.shape[::-1])
        column, row = np.clip(tracks.xy[rows] * shape / size, 0, shape - 1).astype(int).T
        inside[rows] = masked[row, column]
    views = np.bincount(tracks.track, minlength=tracks.count)
    return tracks.only((np.bincount(tracks.track, inside, tracks.count) <= INSIDE * views)[tracks.track])
