"""Videos whose container says how to show them: turned, mirrored, cropped, of several tracks, with alpha."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.audio.stream import AudioStream
from av.stream import Disposition
from av.video.stream import VideoStream
from numpy.typing import NDArray

from .odd_clips import RATE, SIZE

RED, GREEN, BLUE, WHITE = (240, 20, 20), (20, 240, 20), (20, 20, 240), (240, 240, 240)
Matrix = tuple[int, int, int, int]
MATRICES: tuple[Matrix, ...] = (
    (1, 0, 0, 1), (0, 1, -1, 0), (-1, 0, 0, -1), (0, -1, 1, 0),
    (-1, 0, 0, 1), (1, 0, 0, -1), (0, 1, 1, 0), (0, -1, -1, 0),
)  # fmt: skip
"""The 2x2 parts of display matrices: turns by quarters, then those that mirror."""


def corners(size: tuple[int, int] = SIZE) -> NDArray[np.uint8]:
    """A picture (H, W, 3) of a size (width, height): red and green above, blue and white below."""
    quarter = np.array([[RED, GREEN], [BLUE, WHITE]], np.uint8)
    return np.kron(quarter, np.ones((size[1] // 2, size[0] // 2, 1), np.uint8))


def shown(picture: NDArray[np.generic], matrix: Matrix) -> NDArray[np.generic]:
    """A picture (H, W, ...) as a display matrix says: pixel (x, y) goes to (x, y) times the matrix."""
    rows, columns = np.mgrid[: picture.shape[0], : picture.shape[1]]
    a, b, c, d = matrix
    across, down = a * columns + c * rows, b * columns + d * rows
    across, down = across - across.min(), down - down.min()
    made = np.empty((down.max() + 1, across.max() + 1, *picture.shape[2:]), picture.dtype)
    made[down, across] = picture
    return made


def encoded(
    path: Path,
    tracks: Sequence[Sequence[NDArray[np.uint8]]],
    codec: str = "libx264rgb",
    pixels: str = "rgb24",
    matrix: Matrix = (1, 0, 0, 1),
    sounds: Sequence[float] = (),
    **options: str,
) -> Path:
    """Write a video at 25 frames a second, with a track for each list of pictures (H, W, 3 or 4) and a sound
    track for each pitch in Hz."""
    with av.open(str(path), "w") as out:
        streams = []
        for pictures in tracks:
            video = out.add_stream(codec, rate=25, options=options or {"qp": "0"})
            assert isinstance(video, VideoStream)
            video.height, video.width = pictures[0].shape[:2]
            video.pix_fmt = pixels
            a, b, c, d = (value << 16 for value in matrix)
            video.disposition = Disposition.default
            video.set_display_matrix([a, b, 0, c, d, 0, 0, 0, 1 << 30])
            streams.append(video)
        heard = [out.add_stream("aac", rate=RATE) for _ in sounds]
        for sound in heard:
            assert isinstance(sound, AudioStream)
            sound.layout = "mono"
        for video, pictures in zip(streams, tracks, strict=True):
            for number, picture in enumerate(pictures):
                kind = "rgba" if picture.shape[2] == 4 else "rgb24"
                frame = av.VideoFrame.from_ndarray(picture, format=kind).reformat(format=pixels)
                frame.pts, frame.time_base = number, Fraction(1, 25)
                out.mux(video.encode(frame))
            out.mux(video.encode())
        for sound, pitch in zip(heard, sounds, strict=True):
            _write_tone(out, sound, pitch, len(tracks[0]) / 25)
    return path


def _write_tone(out: av.container.OutputContainer, stream: AudioStream, pitch: float, seconds: float) -> None:
    wave = np.sin(2 * np.pi * pitch * np.arange(round(seconds * RATE)) / RATE).astype(np.float32)
    for at in range(0, len(wave), 960):
        part = av.AudioFrame.from_ndarray(0.5 * wave[None, at : at + 960], format="fltp", layout="mono")
        part.sample_rate, part.pts, part.time_base = RATE, at, Fraction(1, RATE)
        out.mux(stream.encode(part))
    out.mux(stream.encode())


def pitch(path: Path) -> float:
    """The pitch of a file's sound in Hz."""
    with av.open(str(path)) as movie:
        parts = [part.to_ndarray().astype(float).mean(axis=0) for part in movie.decode(audio=0)]
        rate = movie.streams.audio[0].rate
    wave = np.concatenate(parts)
    return float(np.argmax(np.abs(np.fft.rfft(wave * np.hanning(len(wave)))))) * rate / len(wave)


def remuxed(path: Path, out: Path) -> Path:
    """The pictures of a video in a file of another kind, with what its container says of them."""
    with av.open(str(path)) as source, av.open(str(out), "w") as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                target.mux(packet)
    return out


def with_clean_aperture(path: Path, size: tuple[int, int], right: int = 0, down: int = 0) -> Path:
    """Have an MP4 show a part (width, height) of its picture, so many pixels from the middle; the file."""
    entry = _boxes_to(path.read_bytes(), b"avc1")[-1]
    box = struct.pack(">I4s8i", 40, b"clap", size[0], 1, size[1], 1, right, 1, down, 1)
    return _grown(path, entry[0] + entry[1], box, b"avc1")


def with_unknown_sound(path: Path) -> Path:
    """Have the first sound track of an MP4 be of a codec that nothing here decodes, Apple's `apac`."""
    data = bytearray(path.read_bytes())
    at = data.index(b"mp4a", data.index(b"moov"))
    data[at : at + 4] = b"apac"
    at = data.index(b"esds", at)
    data[at : at + 4] = b"dapa"
    path.write_bytes(data)
    return path


def _boxes_to(data: bytes | bytearray, entry: bytes) -> list[tuple[int, int]]:
    """Place and size of the boxes around the first sample entry of a kind, and its own."""
    found, at, end = list[tuple[int, int]](), 0, len(data)
    for wanted in (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stsd", entry):
        while at < end:
            size, kind = struct.unpack_from(">I4s", data, at)
            if kind == wanted:
                break
            at += size
        found.append((at, size))
        # A table of sample entries begins with its version and their number.
        at, end = at + (16 if wanted == b"stsd" else 8), at + size
    return found


def _grown(path: Path, at: int, box: bytes, entry: bytes) -> Path:
    """The file with a box put in at a place within a sample entry; the pictures lie before."""
    data = bytearray(path.read_bytes())
    for place, size in _boxes_to(data, entry):
        struct.pack_into(">I", data, place, size + len(box))
    data[at:at] = box
    path.write_bytes(data)
    return path
