"""Clips as cameras, recorders and converters make them, written by PyAV: small, with their oddities."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

SIZE = (64, 48)
RATE = 48000
"""Samples of sound a second."""
TICK = Fraction(1, 12000)
"""Seconds: a whole number of them for 24, 25, 30 and 60 frames a second."""


def steady(count: int, fps: int = 25) -> list[Fraction]:
    """Times of frames at one rate, in seconds."""
    return [Fraction(number, fps) for number in range(count)]


def varying(seconds: int, rates: Sequence[int] = (24, 30, 60), each: int = 2) -> list[Fraction]:
    """Times of frames whose rate changes every `each` seconds."""
    times, at = [], Fraction(0)
    while at < seconds:
        times.append(at)
        at += Fraction(1, rates[int(at // each) % len(rates)])
    return times


def write(
    path: Path,
    times: Sequence[Fraction],
    codec: str = "libx264",
    sound: float | None = None,
    late: float = 0.0,
    flashes: Iterable[Fraction] = (),
    block: int = 8,
    **options: str,
) -> Path:
    """A clip with a picture at each of `times`, noise in blocks of so many pixels that no two
    share, white at `flashes`.

    `sound` is how many seconds of it there are, none without, with a click at each flash; it begins `late`.
    """
    dice, lit = np.random.default_rng(1), set(flashes)
    with av.open(str(path), "w") as out:
        video = out.add_stream(codec, rate=25, options=options)
        video.width, video.height = SIZE
        video.pix_fmt = {"mjpeg": "yuvj420p"}.get(codec, "yuv420p")
        tick = Fraction(1, 25) if path.suffix == ".avi" or codec == "mpeg2video" else TICK
        video.time_base = video.codec_context.time_base = tick
        heard = out.add_stream("aac" if path.suffix != ".webm" else "libopus", rate=RATE) if sound else None
        if heard is not None:
            heard.layout = "mono"
        small = dice.integers(0, 200, (len(times), SIZE[1] // block, SIZE[0] // block, 3), np.uint8)
        for time, blocks in zip(times, small, strict=True):
            picture = (
                np.full((SIZE[1], SIZE[0], 3), 255, np.uint8)
                if time in lit
                else np.kron(blocks, np.ones((block, block, 1), np.uint8))
            )
            if lit and time not in lit:
                picture = picture // 4
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = round(time / tick), tick
            out.mux(video.encode(frame))
        out.mux(video.encode())
        if heard is not None and sound is not None:
            samples = np.zeros((1, round(sound * RATE)), np.float32)
            for flash in lit:
                at = round((float(flash) - late) * RATE)
                samples[0, max(at, 0) : max(at + 48, 0)] = 0.9
            for at in range(0, samples.shape[1], 960):
                part = av.AudioFrame.from_ndarray(
                    np.ascontiguousarray(samples[:, at : at + 960]), format="fltp", layout="mono"
                )
                part.sample_rate, part.pts = RATE, at + round(late * RATE)
                part.time_base = Fraction(1, RATE)
                out.mux(heard.encode(part))
            out.mux(heard.encode())
    return path


def packets(path: Path) -> list[tuple[int, int]]:
    """Where in the file each packet with a picture lies, and its size, in bytes."""
    with av.open(str(path)) as clip:
        return [(each.pos, each.size) for each in clip.demux(video=0) if each.size and each.pos is not None]


def flipped(path: Path, packet: int, seed: int = 0) -> Path:
    """The clip with 20 bytes of a packet changed, in its place."""
    dice, data = np.random.default_rng(seed), bytearray(path.read_bytes())
    at, size = packets(path)[packet]
    for place in dice.integers(at + min(20, size // 4), at + size, 20):
        data[place] ^= 1 << int(dice.integers(8))
    path.write_bytes(data)
    return path


def flashes_and_clicks(path: Path) -> tuple[list[float], list[float]]:
    """When a movie shows white after dark, and when it clicks after silence, in seconds."""
    flashes: list[float] = []
    clicks: list[float] = []
    with av.open(str(path)) as movie:
        was_lit = False
        for frame in movie.decode(video=0):
            is_lit = bool(frame.to_ndarray(format="gray").mean() > 128)
            if is_lit and not was_lit:
                flashes.append(float(frame.time or 0))
            was_lit = is_lit
    with av.open(str(path)) as movie:
        for part in movie.decode(audio=0):
            loud = np.flatnonzero(np.abs(part.to_ndarray().astype(np.float64)[0]) > 0.2)
            for sample in loud:
                at = float(part.time or 0) + int(sample) / part.sample_rate
                if not clicks or at - clicks[-1] > 0.1:
                    clicks.append(at)
    return flashes, clicks
