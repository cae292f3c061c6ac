"""Opening video files with FFmpeg (PyAV): plain files of known kinds, nothing that leads to other files."""

import re
from dataclasses import dataclass
from pathlib import Path

import av
from av.audio.stream import AudioStream
from av.container import InputContainer
from av.stream import Disposition
from av.video.stream import VideoStream

from ..base import memory
from ..base.errors import UserError
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
_PREFERRED = 5_000_000
"""Pixels by which FFmpeg's own program prefers a default track (`ffmpeg_mux_init.c`)."""


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

    Of several video tracks the one that FFmpeg's own program takes: that with most pixels, a default one
    before others, a cover last. Raises UserError if the file cannot be opened or has no pictures that can be
    decoded.
    """
    name = path.name
    try:
        # Absolute, so that no name is taken for an address.
        container = av.open(str(path.absolute()), options=_OPTIONS)
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
    stream = max(container.streams.video, key=_score, default=None)
    if stream is None or not _score(stream):
        container.close()
        raise UserError(f"{name} has no frames that can be decoded; convert it to H.264 and try again")
    return container, stream


def _score(stream: VideoStream) -> int:
    """FFmpeg's preference for a video track; 0 where it cannot be decoded."""
    if stream.codec_context is None:
        return 0
    if Disposition.attached_pic in stream.disposition:
        return 1
    pixels = stream.codec_context.width * stream.codec_context.height
    return 2 + pixels + _PREFERRED * (Disposition.default in stream.disposition)


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
