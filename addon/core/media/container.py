"""Opening video files with FFmpeg (PyAV): plain files of known kinds, nothing that leads to other files."""

from __future__ import annotations

from pathlib import Path

import av
from av.container import InputContainer
from av.video.stream import VideoStream

from ..base import memory
from ..base.errors import UserError

DEMUXERS = (
    "apng", "asf", "av1", "avi", "dv", "flv", "gif", "gxf", "h264", "hevc", "ivf", "m4v", "matroska",
    "webm", "mjpeg", "mov", "mp4", "m4a", "3gp", "3g2", "mj2", "mpeg", "mpegts", "mpegvideo", "mxf", "nut",
    "obu", "ogg", "rm", "vc1", "wtv", "yuv4mpegpipe",
)  # fmt: skip
"""FFmpeg's names of the containers that are read. What is not here opens other files, devices or the network
(ffconcat, HLS, SDP, DASH, IMF ...), or holds no video. A clip's identity is that of its own file, and a
stranger's file must not choose what is read."""
_OPTIONS = {"protocol_whitelist": "file", "format_whitelist": ",".join(DEMUXERS)}
_LISTS = (b"ffconcat", b"#extm3u", b"v=0", b"<mpd", b"<?xml", b"[playlist]")
"""How the text of playlists begins."""


def open_video(path: Path) -> tuple[InputContainer, VideoStream]:
    """A video's container and its pictures, to be closed by the caller; UserError where it has none."""
    name = path.name
    try:
        # Absolute, so that no name is taken for an address.
        container = av.open(str(path.absolute()), options=_OPTIONS)
    except av.FFmpegError as error:
        if memory.is_scarce():
            raise memory.shortage(f"{name} cannot be opened") from None
        with path.open("rb") as file:
            head = file.read(64).lstrip(b"\xef\xbb\xbf \r\n\t").lower()
        if head.startswith(_LISTS):
            raise UserError(f"{name} is a playlist, not a video; choose the video itself") from error
        raise UserError(
            f"{name} is not a video that can be read; convert it to H.264 and try again"
        ) from error
    # Not a cover that a music player shows.
    stream = container.streams.best("video")
    if not isinstance(stream, VideoStream) or stream.codec_context is None:
        container.close()
        raise UserError(f"{name} has no frames that can be decoded; convert it to H.264 and try again")
    return container, stream


def sound_start(path: Path) -> float | None:
    """When the first sample of a video's sound is heard, in seconds on its own clock; None without sound.

    Of the decoded sound: containers' own words for it leave out what encoders put before.
    """
    container, _ = open_video(path)
    with container:
        if not container.streams.audio:
            return None
        try:
            first = next(container.decode(container.streams.audio[0]), None)
        except av.FFmpegError:
            return None
        return None if first is None or first.time is None else float(first.time)
