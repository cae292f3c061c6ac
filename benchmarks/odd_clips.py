"""Clips as cameras, recorders and converters make them, written by PyAV: small, with their oddities."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from av.audio.stream import AudioStream
from av.video.stream import VideoStream
from numpy.typing import NDArray

SIZE = (64, 48)
RATE = 48000
"""Samples of sound a second."""
SOUND = {".avi": "pcm_s16le", ".webm": "libopus"}
"""Codecs of sound; others have AAC. In AVI that begins before the picture, for which FFmpeg holds frame 1."""
LOUD = 0.2
"""Of full scale; a click has 0.9, and what lossy coding puts before it less than this."""
TICK = Fraction(1, 12000)
"""Seconds: a whole number of them for 24, 25, 30 and 60 frames a second."""

LISTS = {
    "ffconcat": "ffconcat version 1.0\nfile clip.mp4\n",
    "m3u8": "#EXTM3U\n#EXT-X-TARGETDURATION:5\n#EXTINF:5,\nclip.ts\n#EXT-X-ENDLIST\n",
    "sdp": "v=0\no=- 0 0 IN IP4 127.0.0.1\ns=x\nc=IN IP4 127.0.0.1\nt=0 0\nm=video 5004 RTP/AVP 96\n",
    "mpd": '<?xml version="1.0"?>\n<MPD><Period><BaseURL>clip.mp4</BaseURL></Period></MPD>\n',
}
"""Texts that lead to `clip.mp4` or `clip.ts` beside them, by their kind."""


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
    lit = set(flashes)
    with _priority_kept(), av.open(str(path), "w") as out:
        video = out.add_stream(codec, rate=25, options=options)
        assert isinstance(video, VideoStream)
        video.width, video.height = SIZE
        video.pix_fmt = {"mjpeg": "yuvj420p"}.get(codec, "yuv420p")
        tick = Fraction(1, 25) if path.suffix == ".avi" or codec == "mpeg2video" else TICK
        video.time_base = video.codec_context.time_base = tick
        heard = out.add_stream(SOUND.get(path.suffix, "aac"), rate=RATE) if sound else None
        if isinstance(heard, AudioStream):
            heard.layout = "mono"
        for time, picture in zip(times, _drawn(times, lit, block), strict=True):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = round(time / tick), tick
            out.mux(video.encode(frame))
        out.mux(video.encode())
        if isinstance(heard, AudioStream) and sound is not None:
            for part in _clicking(sound, late, lit):
                out.mux(heard.encode(part))
            out.mux(heard.encode())
    return path


@contextmanager
def _priority_kept() -> Iterator[None]:
    """Within it, what changes the scheduling policy of this thread does so in vain afterwards.

    SVT-AV1 puts whoever encodes with it as root before all others (SCHED_FIFO), and what that starts then,
    too: a render with all cores lets nothing else run.
    """
    known = hasattr(os, "sched_getscheduler")
    policy = (os.sched_getscheduler(0), os.sched_getparam(0)) if known else None
    try:
        yield
    finally:
        if policy:
            os.sched_setscheduler(0, *policy)


def _drawn(times: Sequence[Fraction], lit: set[Fraction], block: int) -> Iterator[NDArray[np.uint8]]:
    dice, (width, height) = np.random.default_rng(1), SIZE
    small = dice.integers(0, 200, (len(times), height // block, width // block, 3), np.uint8)
    for time, blocks in zip(times, small, strict=True):
        if time in lit:
            yield np.full((height, width, 3), 255, np.uint8)
        else:
            yield np.kron(blocks // 4 if lit else blocks, np.ones((block, block, 1), np.uint8))


def _clicking(seconds: float, late: float, clicks: Iterable[Fraction]) -> Iterator[av.AudioFrame]:
    samples = np.zeros((1, round(seconds * RATE)), np.float32)
    for click in clicks:
        at = round((float(click) - late) * RATE)
        samples[0, max(at, 0) : max(at + 48, 0)] = 0.9
    for at in range(0, samples.shape[1], 960):
        some = np.ascontiguousarray(samples[:, at : at + 960])
        part = av.AudioFrame.from_ndarray(some, format="fltp", layout="mono")
        part.sample_rate, part.pts, part.time_base = RATE, at + round(late * RATE), Fraction(1, RATE)
        yield part


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


def pictures(path: Path) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """When each frame of a movie is shown, (n,) in seconds, and its grey levels, (n, H, W)."""
    with av.open(str(path)) as movie:
        found = [(float(frame.time or 0), frame.to_ndarray(format="gray")) for frame in movie.decode(video=0)]
    return np.array([time for time, _ in found]), np.array([picture for _, picture in found], np.uint8)


def clicks(path: Path) -> NDArray[np.float64]:
    """When a movie is loud after a tenth of a second of silence, in seconds."""
    found: list[float] = []
    with av.open(str(path)) as movie:
        for part in movie.decode(audio=0):
            loud = np.flatnonzero(np.abs(part.to_ndarray().astype(np.float64)[0]) > LOUD)
            for sample in loud:
                at = float(part.time or 0) + int(sample) / part.sample_rate
                if not found or at - found[-1] > 0.1:
                    found.append(at)
    return np.array(found)


def flashes_and_clicks(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """When a movie shows white after dark, and when it clicks, in seconds."""
    times, shown = pictures(path)
    is_lit = shown.mean(axis=(1, 2)) > 128
    return times[is_lit & ~np.roll(is_lit, 1)], clicks(path)
