"""Reading videos with FFmpeg (PyAV): a table of frames, times and damage made once, then frames by number.

PyAV, not OpenCV's FFmpeg, because it gives packets, times, the decoder's errors, more bits and AV1. Measured
with PyAV 19.0.2 and OpenCV 5.0.0: import 0.10 s and 10 MB; 118 frames of 1920x1080 decoded in 1.3 s by both;
8-bit pictures of H.264, HEVC, VP9, MJPEG, MPEG-4, FFV1, PNG and GIF equal to the last bit. It reads, Blender
reads and writes movies, in one process with bpy 5.2.3 and Debian's Blender 5.2.2, loaded before or after. The
wheels are 19 to 35 MB, one a platform for Python 3.12 and later: a fifth of the extension's zip (181 MB on
Linux, 131 on Windows, 116 on macOS), for clips that are read right.
"""

from collections.abc import Iterable
from functools import partial
from pathlib import Path

import av
from av.container import InputContainer
from av.video.frame import VideoFrame
from av.video.stream import VideoStream

from ..base import memory
from ..base.errors import Remedy, UserError
from ..base.lru_cache import LRUCache
from ..base.progress import checkpoint
from .container import open_video
from .frame_table import read_table
from .picture_file import Pixels, resized
from .video_frame import FirstFrame, upright
from .video_info import VideoInfo, is_alike

MISSING = 0.02
"""Share of a clip's frames that may be missing at its end, with a word, before it is refused as truncated."""
PASSED = 64 << 20
"""Bytes of decoded frames that are remembered: 46 of 1280x720. Subjects are carried backwards, and each frame
is sought from its key frame: without them the people of a clip of 195 frames cost 62 s of processor time, of
which 21 decode 7,500 frames, with them 40."""
_known: dict[tuple[str, int, int, int], VideoInfo] = {}
"""By path, size in bytes, and times of modification and change in ns: an unchanged file is decoded once."""


def video_info(path: Path, known: VideoInfo | None = None) -> VideoInfo:
    """Return the properties of a video, which are remembered; without `known` ones it is decoded completely.

    Raises UserError if it cannot be read, or is truncated.
    """
    state = path.stat()
    key = str(path), state.st_size, state.st_mtime_ns, state.st_ctime_ns
    if known is not None:
        _known[key] = known
    elif key not in _known:
        if state.st_size == 0:
            raise UserError(f"{path.name} is empty (0 bytes); copy it again from the camera")
        try:
            _known[key] = _decode_all(path)
        except (av.FFmpegError, MemoryError) as error:
            raise memory.shortage(f"{path.name} cannot be decoded") from error
    return _known[key]


class VideoReader:
    """An open video whose frames are read by number, exactly; in order is cheapest.

    A frame that is not soon to come is sought from the key frame before it. Where the container has no index
    of those, decoding begins anew.
    """

    def __init__(self, path: Path, size: tuple[int, int], pixel_aspect: float = 0.0) -> None:
        """Width and height in pixels of the clip's frames; `pixel_aspect` as of `upright`."""
        self._path, self._size, self._pixel_aspect = path, size, pixel_aspect
        self._container: InputContainer | None = None
        self._stream: VideoStream | None = None
        self._frames: Iterable[VideoFrame] = ()
        self._last = 0
        """Number of the frame that was decoded last; 0 before the first."""
        self._passed = LRUCache[VideoFrame](PASSED, _bytes)
        """The last frames that were decoded, by number."""

    def read(self, frame: int) -> Pixels:
        """Read a frame, from 1 on, as `upright`, scaled to the clip's size where the stored size changes.

        Raises:
            UserError: if it cannot be decoded.
        """
        info = video_info(self._path)
        found = self._passed.known(frame) or self._decoded(info, frame)
        if found is None:
            self.close()
            raise UserError(
                f"frame {frame} of {self._path.name} cannot be decoded; the file may be cut off: convert it"
                " again or leave the frame out",
                Remedy.FRAMES,
            )
        assert self._stream is not None
        picture = upright(found, self._stream, self._pixel_aspect)
        height, width = picture.shape[:2]
        is_scaled = (width, height) != self._size
        return resized(picture, self._size) if is_scaled and is_alike(width, height, *self._size) else picture

    def _decoded(self, info: VideoInfo, frame: int) -> VideoFrame | None:
        key = max(number for number in info.keys if number <= frame)
        if self._container is None or frame <= self._last or key > self._last + 1:
            self._begin(info, key)
        found = self._decode_to(info, frame)
        if found is None and self._container is not None and key > 1:
            # Some containers have a wrong index.
            self._begin(info, 1)
            found = self._decode_to(info, frame)
        return found

    def close(self) -> None:
        """Release the file; the next read opens it again."""
        self._passed = LRUCache[VideoFrame](PASSED, _bytes)
        self._release()

    def _release(self) -> None:
        if self._container is not None:
            self._frames = ()
            self._container.close()
            self._container, self._stream, self._last = None, None, 0

    def _begin(self, info: VideoInfo, key: int) -> None:
        """Have the frames from a key frame on come next."""
        if self._container is None or self._stream is None or key == 1:
            self._release()
            self._container, self._stream = open_video(self._path)
            self._stream.thread_type = "AUTO"
        if key > 1:
            self._container.seek(info.times[key - 1], stream=self._stream)
        self._last = key - 1
        self._frames = _decoded(self._container, self._stream)

    def _decode_to(self, info: VideoInfo, frame: int) -> VideoFrame | None:
        """Decode up to a frame; None where the file ends before, or goes on after it."""
        wanted = info.times[frame - 1]
        for found in self._frames:
            checkpoint()
            self._last += 1
            if self._last <= frame and found.pts == info.times[self._last - 1]:
                self._passed.get(self._last, partial(lambda frame: frame, found))
            if info.is_timed and found.pts is not None:
                if found.pts > wanted:
                    return None
                if found.pts < wanted:
                    continue
                self._last = frame
            if self._last == frame:
                return found
        return None


def _bytes(frame: VideoFrame) -> int:
    return sum(plane.buffer_size for plane in frame.planes)


def _decoded(container: InputContainer, stream: VideoStream) -> Iterable[VideoFrame]:
    """Frames as they are shown; packets that cannot be decoded give none."""
    for packet in container.demux(stream):
        try:
            yield from packet.decode()
        except av.FFmpegError as error:
            if memory.is_shortage(error):
                raise


def _decode_all(path: Path) -> VideoInfo:
    info = read_table(path)
    claimed = info.count + info.missing
    if info.missing > MISSING * claimed:
        raise UserError(
            f"{path.name} is cut off: frame {info.count + 1} of {claimed} cannot be decoded; copy or"
            " convert it again"
        )
    return info


def first_frame(path: Path, pixel_aspect: float = 0.0) -> FirstFrame:
    """Decode a video's first frame; `pixel_aspect` as of `upright`. UserError if it cannot be decoded."""
    container, stream = open_video(path)
    with container:
        for frame in _decoded(container, stream):
            return FirstFrame.of(frame, stream, pixel_aspect)
    raise UserError(f"{path.name} has no frame that can be decoded; convert it to H.264 and try again")
