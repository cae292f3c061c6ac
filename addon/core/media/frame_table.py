"""A video's frames, times and damage, from its packets and their decoder, in one pass over the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.container import InputContainer
from av.packet import Packet
from av.video.stream import VideoStream

from ..base import memory
from ..base.errors import UserError
from ..base.progress import checkpoint
from .constant_rate import FASTEST, keeps_rate
from .container import Sound, find_sound, open_video
from .video_frame import FirstFrame
from .video_info import VideoInfo

DEFAULT_RATE = Fraction(24)
"""Frames a second of a clip without a usable rate: cinema's."""
EXACT = 0.002
"""Frames by which times may be off an exact rate, besides a tick: 23.976 for 24000/1001, after a minute."""
_STRICT = {"err_detect": "crccheck+bitstream+buffer+explode"}
_HIDING = ("ffv1", "hevc", "mjpeg")
"""Decoders that report broken packets in strict mode only; others mark repaired frames."""
_RACING = ("mpeg4",)
"""Decoders that, where several threads decode frames, hand a frame on before they know whether it is damaged:
on a busy machine a quarter of 300 passes over one damaged clip found nothing."""
_WHOLE = ("matroska", "mov")
"""Containers whose packets hold a whole frame each, both fields included; they know where key frames are."""
_HIDES = ("vp8", "vp9")
"""Codecs some of whose packets are never shown, only referred to."""
NEAR = 0.6
"""Largest distance of a broken packet from its frame, in median frame intervals; a field is at 0.5."""
SHORT = 0.1
"""Seconds by which a container may promise more than it holds: some count a packet of sound more, ASF its
preroll, and FLV's writers round."""
INDEX = 24
"""Bytes of an AVI's index with one entry, without which it ends in a packet: each has a head of 8 bytes."""
ABRUPT = 0.75
"""Share of the longest frame interval by which a video may end earlier than its stream's duration."""


@dataclass
class _Pass:
    """The values collected while a file is read."""

    packets: list[int | None] = field(default_factory=list)
    """Times of the packets that are to be shown."""
    count: int = 0
    """Number of packets with pictures in them."""
    frames: list[int | None] = field(default_factory=list)
    """Times of the frames, in the order in which they are shown."""
    keys: list[int] = field(default_factory=list)
    """Places in `frames` of key frames, which need no other frame."""
    sizes: list[tuple[int, int, int]] = field(default_factory=list)
    """Place in `frames` from which pictures have a width and height in pixels."""
    interlaced: int = 0
    """How many frames are marked as interlaced."""
    corrupt: set[int] = field(default_factory=set)
    """Places in `frames` of those that the decoder calls damaged."""
    broken: list[tuple[int | None, int]] = field(default_factory=list)
    """Packets that are broken or incomplete: their time, and the number of frames shown before."""
    promised: int = 0
    """Entries of the container's own index of pictures, before any is read."""
    reach: int = 0
    """Offset in the file, in bytes, at which its last packet ends; a shorter file was cut off."""
    last: int = -1
    """The last packet's time of decoding, in ticks."""
    first: FirstFrame | None = None
    """Properties of the first frame."""
    end: Fraction = Fraction(0)
    """Where the last packet of any stream ends, in seconds."""
    shown_until: Fraction = Fraction(0)
    """Where the last packet with a picture ends, in seconds."""


def read_table(path: Path) -> VideoInfo:
    """Decode a video to its end; passes checkpoints.

    Raises UserError if it cannot be opened, or no frame can be decoded.
    """
    container, stream = open_video(path)
    with container:
        found = _read(container, stream, "AUTO")
    if found.broken and not _is_whole(container):
        # With threads, the decoder reports a broken packet some packets later.
        container, stream = open_video(path)
        with container:
            found = _read(container, stream, "NONE")
    if found.first is None:
        raise UserError(f"{path.name} has no frame that can be decoded; convert it to H.264 and try again")
    container, stream = open_video(path)
    with container:
        return _table(container, stream, found, found.first, find_sound(path))


def _read(container: InputContainer, stream: VideoStream, threads: str) -> _Pass:
    found = _Pass(promised=len(stream.index_entries))
    if stream.codec_context.name in _HIDING:
        stream.codec_context.options = _STRICT
    stream.thread_type = "SLICE" if stream.codec_context.name in _RACING else threads
    claimed = stream.frames or int(
        float(stream.average_rate or DEFAULT_RATE) * float((container.duration or 0) / av.time_base)
    )
    for packet in _packets(container):
        if packet.pos is not None:
            found.reach = max(found.reach, packet.pos + packet.size)
        if packet.pts is not None and packet.time_base:
            end = _end(packet)
            found.end = max(found.end, end)
        if packet.stream.index != stream.index:
            continue
        if packet.size:
            _count(found, packet)
        _decode(found, packet)
        checkpoint(min(1.0, found.count / max(claimed, 1)))
    return found


def _packets(container: InputContainer) -> Iterator[Packet[Any]]:
    """The packets of all streams, up to the end or to the first unreadable part."""
    packets = container.demux()
    while True:
        try:
            yield next(packets)
        except StopIteration:
            return
        except av.FFmpegError as error:
            if memory.is_shortage(error):
                raise
            return


def _count(found: _Pass, packet: Packet[VideoStream]) -> None:
    found.count += 1
    if packet.dts is not None:
        found.last = max(found.last, packet.dts)
    if packet.pts is not None and packet.time_base:
        end = _end(packet)
        found.shown_until = max(found.shown_until, end)
    if not packet.is_discard:
        found.packets.append(packet.pts)
        if packet.is_corrupt:
            found.broken.append((packet.pts, len(found.frames)))


def _decode(found: _Pass, packet: Packet[VideoStream]) -> None:
    try:
        frames = packet.decode()
    except av.FFmpegError as error:
        if memory.is_shortage(error):
            raise
        if not packet.is_discard:
            found.broken.append((packet.pts, len(found.frames)))
        return
    for frame in frames:
        if found.first is None:
            found.first = FirstFrame.of(frame, packet.stream)
        if frame.is_corrupt:
            found.corrupt.add(len(found.frames))
        if frame.key_frame:
            found.keys.append(len(found.frames))
        if not found.sizes or found.sizes[-1][1:] != (frame.width, frame.height):
            found.sizes.append((len(found.frames), frame.width, frame.height))
        found.interlaced += frame.interlaced_frame
        found.frames.append(frame.pts)


def _table(
    container: InputContainer, stream: VideoStream, found: _Pass, first: FirstFrame, sound: Sound | None
) -> VideoInfo:
    plausible = [rate for rate in (stream.guessed_rate, stream.average_rate) if rate and 0 < rate <= FASTEST]
    rates = tuple(map(_fraction, plausible)) or (DEFAULT_RATE,)
    known = [time for time in found.frames if time is not None]
    is_timed = len(known) == len(found.frames) and bool(np.all(np.diff(known) > 0))
    if is_timed:
        tick = _fraction(stream.time_base) if stream.time_base else 1 / rates[0]
        lost = _lost(container, stream, found, known)
        times = sorted([*known, *lost])
        at = {time: number for number, time in enumerate(times, 1)}
        bad = {at[known[each]] for each in found.corrupt} | {at[time] for time in lost}
        bad |= {at[_nearest(times, time)] for time, before in found.broken if time is not None and before}
        keys = (1, *(at[known[each]] for each in found.keys if each)) if _is_whole(container) else (1,)
        sizes = tuple((at[known[place]], width, height) for place, width, height in found.sizes)
    else:
        # Frames follow each other at the rate, one tick each.
        tick, times, keys = 1 / rates[0], list(range(len(found.frames))), (1,)
        near = {min(before, len(found.frames) - 1) for _, before in found.broken if before}
        bad = {at + 1 for at in near | found.corrupt}
        sizes = tuple((place + 1, width, height) for place, width, height in found.sizes)
    seconds = np.array([float((time - times[0]) * tick) for time in times])
    mean = (len(seconds) - 1) / float(seconds[-1]) if len(seconds) > 1 else float(rates[0])
    likely = [*map(float, rates), mean]
    # FFmpeg guesses 240 for 241 a second; an exact rate is off by the rounding of times alone.
    exact = (rate for rate in likely if keeps_rate(seconds, rate, min(0.5, EXACT + rate * tick)))
    fps = next(exact, None) or next((rate for rate in likely if keeps_rate(seconds, rate)), mean)
    begins = None if sound is None else sound.start
    if begins is not None:
        begins = begins - float(times[0] * tick) if is_timed else 0.0
    remarks = _remarks(2 * found.interlaced > len(found.frames), first.lacks_alpha, sound)
    return VideoInfo(
        first.width, first.height, float(fps), (tick.numerator, tick.denominator), tuple(times),
        is_timed, keys, begins, tuple(sorted(bad)), _missing(container, stream, found, rates[0]),
        first.colour_space, first.view, sound.track if sound else 0, sizes, tuple(remarks),
    )  # fmt: skip


def _remarks(is_interlaced: bool, lacks_alpha: bool, sound: Sound | None) -> Iterator[str]:
    """Notes on a video for the user besides its frames, a line each."""
    if is_interlaced:
        yield (
            "the clip is interlaced: each frame holds two moments in alternate rows, which comb where"
            " something moves; deinterlace it first, for example with FFmpeg's bwdif"
        )
    if lacks_alpha:
        yield (
            "the clip's transparency is not read: it is stored as VP8's or VP9's, for which there is no"
            " decoder here; convert the clip to ProRes 4444 or PNG"
        )
    if sound is not None and sound.unknown:
        named = " and ".join(sorted(set(sound.unknown)))
        if sound.start is None:
            yield f"the clip's sound ({named}) cannot be decoded: movies are silent; convert it to AAC"
        else:
            yield (
                f"a sound track of the clip ({named}) cannot be decoded; movies have track"
                f" {sound.track + 1} instead"
            )


def _lost(container: InputContainer, stream: VideoStream, found: _Pass, known: list[int]) -> list[int]:
    """Times of frames that should have been shown, after the first that was."""
    times = {time for time, _ in found.broken if time is not None}
    # AVI counts frames that are not coded.
    if (found.broken or _kind(container) != "avi") and stream.codec_context.name not in _HIDES:
        times |= {time for time in found.packets if time is not None} - set(known)
    if len(known) < 2:
        return []
    # Elsewhere second fields may have packets of their own, half a frame away.
    apart = 0.0 if _is_whole(container) else NEAR * float(np.median(np.diff(known)))
    return sorted(time for time in times if time > known[0] and abs(time - _nearest(known, time)) > apart)


def _end(packet: Packet[Any]) -> Fraction:
    """The end of a timed packet in seconds."""
    return ((packet.pts or 0) + (packet.duration or 0)) * _fraction(packet.time_base)


def _fraction(ratio: Any) -> Fraction:
    return Fraction(ratio.numerator, ratio.denominator)


def _nearest(times: list[int], wanted: int) -> int:
    at = int(np.searchsorted(times, wanted))
    return min(times[max(0, at - 1) : at + 1], key=lambda time: abs(time - wanted))


def _missing(container: InputContainer, stream: VideoStream, found: _Pass, rate: Fraction) -> int:
    """Frames that the container promises and does not hold."""
    kind = _kind(container)
    if kind == "mov" and found.promised:
        return max(0, found.promised - found.count)
    if kind == "avi":
        # The header counts empty packets, which are not given. An index comes after all pictures.
        is_cut = found.reach + INDEX > (container.size or 0)
        return max(0, stream.frames - found.last - 1) if is_cut else 0
    if not container.duration:
        return 0
    promised = Fraction(container.duration, av.time_base)
    if kind != "matroska":
        # Those count from the first packet on.
        promised += Fraction(container.start_time or 0, av.time_base)
    own = _seconds(stream.metadata.get("DURATION", "")) if kind == "matroska" else None
    times = [time for time in found.packets if time is not None]
    longest = float(max(np.diff(np.unique(times)), default=0)) * float(stream.time_base or 0)
    short = float(promised - found.end if own is None else own - found.shown_until)
    if short <= max(ABRUPT * longest, 0.0 if own is not None and longest else SHORT):
        return 0
    return max(1, round(float((own or promised) - found.shown_until) * float(rate)))


def _seconds(text: str) -> Fraction | None:
    """Matroska's tag "00:00:04.023000000"; None for others."""
    try:
        hours, minutes, seconds = text.split(":")
        return 3600 * int(hours) + 60 * int(minutes) + Fraction(seconds)
    except ValueError:
        return None


def _kind(container: InputContainer) -> str:
    """FFmpeg's first name of a container."""
    return container.format.name.split(",")[0]


def _is_whole(container: InputContainer) -> bool:
    return _kind(container) in _WHOLE
