"""Leave people out of a clip's tracks, so that cameras are found from the static scene alone."""

from collections.abc import Callable

import cv2
import numpy as np

from ...base.arrays import Mask
from ...media.clip import Footage
from ...subjects.networks import Networks
from ...subjects.people import SEEN_IN, bodies, people, sampled
from ...subjects.pictures import small
from .tracks import Progress, Tracks

MARGIN = 0.01
"""Width by which people are enlarged, as a share of the long side: corners on an outline move with it."""
INSIDE = 0.5
"""Share of a track's observations that lie on people, from which on the track is theirs."""
LOOKS = 24
"""Frames in which people are looked for; tracks are compared with the nearest of them. People carried through
all frames cost four to ten times as much on clips of 40 to 170 frames, for nearly the same tracks."""


def without_people(
    tracks: Tracks, footage: Footage, progress: Progress, networks: Networks | None = None
) -> Tracks | None:
    """Return the tracks that are not on people, if people are the clip's subjects.

    Args:
        tracks: Those of the clip.
        footage: The clip.
        progress: Called with the stage, done and all looks.
        networks: Those that recognise people.

    Returns:
        Tracks with the same numbers, without the observations of the tracks on people; None where the
            networks are missing, or find no people.

    Raises:
        UserError: A frame cannot be read.
    """
    networks = networks or Networks()
    if not networks.exist:
        return None
    asked, masks, showing = sampled(footage.frames), dict[int, Mask](), 0
    looks = sorted({*sampled(footage.frames, LOOKS), *asked})
    for done, frame in enumerate(looks):
        progress("Looking for people", done, len(looks))
        picture = small(footage.read(frame))
        showing += frame in asked and bool(people(networks, picture))
        shares = bodies(networks, picture)
        masks[frame] = np.max([np.zeros(picture.shape[:2]), *shares], axis=0) > 0.5
    if showing < min(SEEN_IN, len(asked)):
        return None
    return outside(tracks, lambda frame: masks[min(masks, key=lambda each: abs(each - frame))])


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
        masked = _enlarged(mask(frame))
        shape = np.array(masked.shape[::-1])
        column, row = np.clip(tracks.xy[rows] * shape / size, 0, shape - 1).astype(int).T
        inside[rows] = masked[row, column]
    views = np.bincount(tracks.track, minlength=tracks.count)
    return tracks.only((np.bincount(tracks.track, inside, tracks.count) <= INSIDE * views)[tracks.track])


def _enlarged(mask: Mask) -> Mask:
    side = 2 * max(round(MARGIN * max(mask.shape)), 1) + 1
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)) > 0)
