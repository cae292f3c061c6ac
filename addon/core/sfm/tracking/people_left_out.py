"""Leave people out of a clip's tracks, so that cameras are found from the static scene alone."""

from collections.abc import Callable

import cv2
import numpy as np

from ...base.arrays import Bytes, Mask
from ...media.clip import Footage
from ...subjects.carried import PeopleOfClip
from ...subjects.networks import Networks
from ...subjects.pictures import ClipPictures, small
from .tracks import Progress, Tracks

MARGIN = 0.01
"""Width by which people are enlarged, as a share of the long side: corners on an outline move with it."""
INSIDE = 0.5
"""Share of a track's observations that lie on people, from which on the track is theirs."""


def without_people(
    tracks: Tracks, footage: Footage, progress: Progress, networks: Networks | None = None
) -> Tracks | None:
    """Return the tracks that are not on people, if people are the clip's subjects.

    Args:
        tracks: Those of the clip.
        footage: The clip.
        progress: Called with the stage, done and all frames.
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
    frames = footage.frames
    pictures = dict[int, Bytes]()
    # People are followed backwards, too: a video is read forwards many times faster.
    for done, frame in enumerate(frames):
        progress("Reading pictures", done, len(frames))
        pictures[frame] = small(footage.read(frame))
    looked_at = set[int]()

    def read(frame: int) -> Bytes:
        looked_at.add(frame)
        progress("Looking for people", len(looked_at), len(frames))
        return pictures[frame]

    people = PeopleOfClip(ClipPictures(frames, read), networks)
    return outside(tracks, people.mask) if people.tracks else None


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
