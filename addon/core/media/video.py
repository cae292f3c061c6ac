"""Reading videos with OpenCV's FFmpeg: frames in their true geometry, counted once.

PyAV reads the same pixels, seeks exactly and gives more than 8 bits and the transfer curve (HLG), for a wheel
of 19 to 35 MB a platform. Nothing here seeks and nothing after it knows HLG: once it does, look again.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..base import memory
from ..base.errors import Remedy, UserError
from ..base.progress import checkpoint
from .picture_file import Pixels, to_rgb

# FFmpeg's own complaints would stand beside the one line that we say.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

DEFAULT_FPS = 24.0
"""Frames a second of a clip that tells no usable rate: cinema's."""


@dataclass(frozen=True)
class VideoInfo:
    """What is known of a video once it was decoded to its end, which takes milliseconds a frame."""

    count: int
    """Frames that can be decoded; the container's own count may be wrong."""
    width: int
    """Pixels across of the upright picture with square pixels."""
    height: int
    """Pixels down of the upright picture with square pixels."""
    fps: float
    """Frames a second."""

    @classmethod
    def parse(cls, kept: Any) -> VideoInfo | None:
        """From the object that a file kept of it; None where there is none or it cannot be."""
        try:
            info = cls(int(kept["count"]), int(kept["width"]), int(kept["height"]), float(kept["fps"]))
        except (KeyError, TypeError, ValueError, OverflowError):
            return None
        return info if min(info.count, info.width, info.height) > 0 and 0 < info.fps < 1000 else None


_known: dict[tuple[str, int, int, int], VideoInfo] = {}
"""By path, size in bytes, and times of modification and change in ns: an unchanged file is decoded once."""


def video_info(path: Path, known: VideoInfo | None = None) -> VideoInfo:
    """What is known of a video: `known`, which is kept for later calls, or found by decoding all of it once.

    UserError where it cannot be read or is truncated.
    """
    state = path.stat()
    key = str(path), state.st_size, state.st_mtime_ns, state.st_ctime_ns
    if known is not None:
        _known[key] = known
    elif key not in _known:
        if state.st_size == 0:
            raise UserError(f"{path.name} is empty (0 bytes); copy it again from the camera")
        _known[key] = _decode_all(path)
    return _known[key]


class VideoReader:
    """An open video, read forwards: an earlier frame than the last one opens it again.

    Seeking is not exact in every codec; decoding from the start always is.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._capture: cv2.VideoCapture | None = None
        self._next = 1

    def read(self, frame: int) -> Pixels:
        """(H, W, 3) uint8 RGB of a frame, from 1 on; UserError where it cannot be decoded."""
        if self._capture is None or frame < self._next:
            self.close()
            self._capture, self._next = _open_capture(self._path), 1
        while self._next < frame:
            checkpoint()
            if not self._capture.grab():
                break
            self._next += 1
        done, bgr = self._capture.read()
        if not done or bgr is None:
            self.close()
            if memory.is_scarce():
                raise memory.shortage(f"frame {frame} of {self._path.name} cannot be decoded")
            raise UserError(
                f"frame {frame} of {self._path.name} cannot be decoded; the file may be truncated:"
                " convert it again or leave the frame out",
                Remedy.FRAMES,
            )
        self._next += 1
        return _to_square_pixels(to_rgb(bgr), self._capture)

    def close(self) -> None:
        """Release the file; the next read opens it again."""
        if self._capture is not None:
            self._capture.release()
            self._capture = None


def _decode_all(path: Path) -> VideoInfo:
    capture = _open_capture(path)
    done, bgr = capture.read()
    if not done or bgr is None:
        if memory.is_scarce():
            raise memory.shortage(f"{path.name} cannot be decoded")
        raise UserError(f"{path.name} has no frame that can be decoded; convert it to H.264 and try again")
    height, width = _to_square_pixels(to_rgb(bgr), capture).shape[:2]
    fps = capture.get(cv2.CAP_PROP_FPS)
    claimed = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    # The header's count may be wrong. Grabbing decodes without converting: a few milliseconds a frame.
    count = 1
    while capture.grab():
        count += 1
        checkpoint(min(1.0, count / max(claimed, 1)))
    capture.release()
    if claimed - count > max(2, claimed // 50):
        if memory.is_scarce():
            raise memory.shortage(f"{path.name} cannot be decoded to its end")
        raise UserError(
            f"{path.name} is truncated: frame {count + 1} of {claimed} cannot be decoded;"
            " copy or convert it again"
        )
    usable = fps if np.isfinite(fps) and 0 < fps < 1000 else DEFAULT_FPS
    return VideoInfo(count, width, height, float(usable))


def _open_capture(path: Path) -> cv2.VideoCapture:
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    finally:
        cv2.utils.logging.setLogLevel(level)
    if not capture.isOpened():
        if memory.is_scarce():
            raise memory.shortage(f"{path.name} cannot be opened")
        raise UserError(f"{path.name} is not a video that can be read; convert it to H.264 and try again")
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
    return capture


def _to_square_pixels(picture: Pixels, capture: cv2.VideoCapture) -> Pixels:
    """Stored pixels -> square pixels: the sample aspect ratio stretches the width."""
    across, down = capture.get(cv2.CAP_PROP_SAR_NUM), capture.get(cv2.CAP_PROP_SAR_DEN)
    if not (across > 0 and down > 0) or across == down:
        return picture
    height, width = picture.shape[:2]
    is_on_side = int(capture.get(cv2.CAP_PROP_ORIENTATION_META)) % 180 != 0
    # A clip that is shown on its side has its stored width upright.
    size = (width, round(height * across / down)) if is_on_side else (round(width * across / down), height)
    shrinks = size[0] * size[1] < width * height
    resized = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC)
    return np.asarray(resized, dtype=picture.dtype)
