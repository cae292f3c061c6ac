"""Opening video files with FFmpeg (PyAV): plain files of known kinds, nothing that leads to other files."""

import contextlib
import re
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from av.audio.stream import AudioStream
from av.container import InputContainer
from av.stream import Disposition
from av.video.stream import VideoStream

from ..base import memory
from ..base.errors import UserError
from ..base.lru_cache import LRUCache
from ..camera.focal_length import PLAUSIBLE

DEMUXERS = (
    "apng", "asf", "av1", "avi", "dv", "flv", "gif", "gxf", "h264", "hevc", "ivf", "m4v", "matroska",
    "webm", "mjpeg", "mov", "mp4", "m4a", "3gp", "3g2", "mj2", "mpeg", "mpegts", "mpegvideo", "mxf", "nut",
    "obu", "ogg", "rm", "vc1", "wtv", "yuv4mpegpipe",
)  # fmt: skip
"""FFmpeg's names of the containers that are read. Others open more files, devices or the network (ffconcat,
HLS, SDP, DASH, IMF ...), or hold no video. A clip's identity is that of the file, and a foreign file must not
choose other files."""
_OPTIONS = {"protocol_whitelist": "file", "format_whitelist": ",".join(DEMUXERS)}
_LISTS = (b"ffconcat", b"#extm3u", b"v=0", b"<mpd", b"<?xml", b"[playlist]")
"""How the text of playlists begins."""
_EQUIVALENT = "com.apple.quicktime.camera.focal_length.35mm_equivalent"
_BESIDE = Disposition.attached_pic | Disposition.timed_thumbnails | Disposition.dependent
"""Tracks that are no clip: covers, thumbnails, and additions to another track."""
STILLS = 0.1
"""Share of the frames of the track with most, under which a track is of stills: that of a phone, taken during
a clip of 53 frames, has 2."""
FEWEST = 3
"""Frames of a track that moves: two are a still and its end."""
_chosen = LRUCache[int]()
"""Index of the stream of a file with several tracks, by its path, size in bytes and time of change in ns."""


@dataclass(frozen=True)
class Sound:
    """The sound of a video."""

    start: float | None
    """When the first sample of its track is heard, in seconds on the video's own clock; None where no track
    can be decoded."""
    track: int
    """Place of the first track that can be decoded among those of sound."""
    unknown: tuple[str, ...]
    """Codecs of the tracks before it, which cannot be decoded."""


def open_video(path: Path) -> tuple[InputContainer, VideoStream]:
    """Open a video's container and its pictures, to be closed by the caller.

    The longest video track is opened, but for stills and covers; among those that are as long within a frame,
    a default one, then the one with most pixels. Raises UserError if the file cannot be opened or has no
    pictures that can be decoded.
    """
    container = _opened(path)
    tracks = [
        stream
        for stream in container.streams.video
        if stream.codec_context is not None and not stream.disposition & _BESIDE
    ]
    if not tracks:
        container.close()
        raise UserError(f"{path.name} has no frames that can be decoded; convert it to H.264 and try again")
    if len(tracks) == 1:
        return container, tracks[0]
    state = path.stat()
    key = str(path.absolute()), state.st_size, state.st_mtime_ns
    index = _chosen.get(key, lambda: _longest(path, [stream.index for stream in tracks]))
    return container, next(stream for stream in tracks if stream.index == index)


def _opened(path: Path) -> InputContainer:
    name = path.name
    try:
        # Absolute, so that no name is taken for an address.
        return av.open(str(path.absolute()), options=_OPTIONS)
    except av.FFmpegError as error:
        if memory.is_shortage(error):
            raise memory.shortage(f"{name} cannot be opened") from None
        with path.open("rb") as file:
            head = file.read(64).lstrip(b"\xef\xbb\xbf \r\n\t").lower()
        if head.startswith(_LISTS):
            raise UserError(f"{name} is a playlist, not a video; choose the video itself") from error
        raise UserError(
            f"{name} is not a video that can be read; convert it to H.264 and try again"
        ) from error


def _longest(path: Path, tracks: list[int]) -> int:
    """The index of the stream, of several, that `open_video` takes, by the times of their packets."""
    times: dict[int, list[float]] = {index: [] for index in tracks}
    with _opened(path) as container:
        with contextlib.suppress(av.FFmpegError):  # a damaged file is read up to there
            for packet in container.demux([container.streams[index] for index in tracks]):
                at = packet.dts if packet.pts is None else packet.pts
                if packet.size and not packet.is_discard and at is not None:
                    times[packet.stream.index].append(float(at * packet.time_base))
        most = max(map(len, times.values()))
        moving = [index for index in tracks if len(times[index]) >= max(FEWEST, STILLS * most)] or tracks
        # Duration of a frame: the last is as long as the others.
        apart = {index: np.ptp(times[index] or [0.0]) / max(1, len(times[index]) - 1) for index in moving}
        lasts = {index: apart[index] * len(times[index]) for index in moving}
        longest = max(moving, key=lambda index: lasts[index])

        def score(index: int) -> tuple[bool, bool, int]:
            stream = container.streams[index]
            assert isinstance(stream, VideoStream)
            is_long = bool(lasts[longest] - lasts[index] <= max(apart[index], apart[longest]) + 1e-6)
            pixels = stream.codec_context.width * stream.codec_context.height
            return is_long, Disposition.default in stream.disposition, pixels

        return max(moving, key=score)


def find_sound(path: Path) -> Sound | None:
    """Find the first sound track of a video that can be decoded; None without any track.

    Its start is that of the decoded sound: containers' own words for it leave out what encoders put before.
    """
    unknown: list[str] = []
    container, _ = open_video(path)
    with container:
        for track, stream in enumerate(container.streams.audio):
            if track:
                container.seek(0)
            start = _start(container, stream)
            if start is not None:
                return Sound(start, track, tuple(unknown))
            unknown.append(_codec(container, stream))
        return Sound(None, 0, tuple(unknown)) if unknown else None


def _codec(container: InputContainer, stream: AudioStream) -> str:
    """Name of a track's codec: FFmpeg's where it has one, else its four characters in the file."""
    if stream.codec_context is not None:
        return stream.codec_context.name
    level = av.logging.get_level()
    av.logging.set_level(av.logging.INFO)  # below it FFmpeg describes nothing
    try:
        described = container.dumps_format()
    finally:
        av.logging.set_level(level)
    found = re.search(rf"Stream #0:{stream.index}\b.*?Audio: (?:none|unknown)? ?\(?(\w+)", described)
    return found[1] if found else "unknown codec"


def equivalent_focal(path: Path) -> float | None:
    """Read the 35 mm equivalent in millimetres from a video's own metadata.

    None where the file holds none, or one that no lens has. Raises UserError if it cannot be opened.
    """
    container, _ = open_video(path)
    with container:
        try:
            found = float(container.metadata.get(_EQUIVALENT, ""))
        except ValueError:
            return None
    return found if PLAUSIBLE[0] < found < PLAUSIBLE[1] else None


def _start(container: InputContainer, stream: AudioStream) -> float | None:
    """When a track's first sample is heard, in seconds; None where it cannot be decoded."""
    if stream.codec_context is None:
        return None
    try:
        first = next(container.decode(stream), None)
    except av.FFmpegError:
        return None
    return None if first is None or first.time is None else float(first.time)


def copy_sound(path: Path, track: int, out: Path) -> None:
    """Copy one sound track of a video, as it is coded, into a file whose suffix is its format.

    Raises:
        OSError: The file cannot be written.
    """
    container, _ = open_video(path)
    with container, av.open(str(out), "w") as copy:
        source = container.streams.audio[track]
        target = copy.add_stream_from_template(source)
        for packet in container.demux(source):
            if packet.dts is not None:
                packet.stream = target
                copy.mux(packet)
