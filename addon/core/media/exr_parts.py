"""Parts, channels and windows of an OpenEXR file, and one of its channels as a separate file.

Blender's decoder reads files of one layer only, and returns the pixels of the data window. Compressed pixels
are not changed: only the header gets other names ("OpenEXR File Layout").
"""

import contextlib
import io
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

MAGIC = b"\x76\x2f\x31\x01"
VERSION = 2
"""Version of the format: the lowest byte of the four after `MAGIC`."""
TILED, LONG_NAMES, MULTI_PART = 0x200, 0x400, 0x1000
"""Flags beside the version."""
SHORT_NAME, LONGEST_NAME = 31, 255
"""Bytes of names: up to the first a file does without `LONG_NAMES`."""
DWA = (8, 9)
"""Compressions that treat a channel by its name."""
NEEDED = {"channels", "dataWindow", "displayWindow", "compression"}
"""Attributes that every part has; where there are several, `chunkCount`, too."""
OF_PARTS = ("name", "type", "chunkCount", "view", "multiView", "BlenderMultiChannel")
"""Attributes that only files of several parts or layers have."""
COLOURS = {"colorInteropID": "string", "chromaticities": "chromaticities", "acesImageContainerFlag": "int"}
"""Attributes that name the colours, and their types; the first one counts before the others."""
MOST_LISTED = 12
"""Channels that a message lists."""
MOST_BYTES = 1 << 24
"""Most bytes of an attribute, such as a preview picture."""
MOST_PIXELS = 1 << 28
"""Most pixels of a display window."""
VALUES = ("z", "depth", "v", "y", "r", "x")
"""Channels that hold the values of a depth layer, the first one before the others."""
Window = tuple[int, int, int, int]
"""Left, top, right and bottom pixel, all inside."""


class LayerError(ValueError):
    """The layers of a file are not those that are needed; one line that names them."""


@dataclass(frozen=True)
class Channel:
    """A channel of a part."""

    part: int
    name: str
    """As the file has it: "ViewLayer.Depth.Z"."""
    label: str
    """With the part's name before it, if that is not in it."""

    @property
    def layer(self) -> str:
        """The label without its last word, in lower case."""
        return self.label.rpartition(".")[0].lower()

    @property
    def leaf(self) -> str:
        """The label's last word, in lower case."""
        return self.label.rpartition(".")[2].lower()


@dataclass(frozen=True)
class Part:
    """A part of a file: all of it, in files of one."""

    attributes: dict[str, tuple[bytes, bytes]]
    """Type and value by name."""

    @property
    def channels(self) -> dict[str, bytes]:
        """The header's entry of each channel, by name, in the order of their pixels."""
        found, listed = dict[str, bytes](), self.attributes["channels"][1]
        while listed[:1] not in (b"", b"\0"):
            name, listed = listed.split(b"\0", 1)
            found[name.decode()], listed = listed[:16], listed[16:]
        return found

    @property
    def data_window(self) -> Window:
        """The pixels that the part has."""
        return _box(self.attributes["dataWindow"][1])

    @property
    def display_window(self) -> Window:
        """The picture that they are of."""
        return _box(self.attributes["displayWindow"][1])

    @property
    def name(self) -> str:
        """Its name; empty in a file of one part."""
        return self.attributes.get("name", (b"", b""))[1].decode()


@dataclass(frozen=True)
class ExrHeader:
    """The header of a file."""

    flags: int
    parts: tuple[Part, ...]
    size: int
    """Bytes."""

    @property
    def channels(self) -> list[Channel]:
        """All channels of all parts."""
        found = []
        for number, part in enumerate(self.parts):
            for name in part.channels:
                is_named = not part.name or name.startswith(f"{part.name}.") or "." in name
                found.append(Channel(number, name, name if is_named else f"{part.name}.{name}"))
        return found

    @property
    def has_layers(self) -> bool:
        """Return whether it has several parts, or channels with the names of layers."""
        return len(self.parts) > 1 or any("." in each.name for each in self.channels)


def read_header(file: BinaryIO) -> ExrHeader:
    """Read the header of an open file; ValueError where it is none."""
    magic, version = file.read(4), file.read(4)
    if magic != MAGIC or len(version) < 4:
        raise ValueError("it is not OpenEXR")
    flags = int.from_bytes(version, "little") & ~0xFF
    parts = [Part(_attributes(file))]
    while flags & MULTI_PART and (attributes := _attributes(file)):
        parts.append(Part(attributes))
    needed = NEEDED | ({"chunkCount"} if flags & MULTI_PART else set())
    if any(not needed <= set(part.attributes) or not part.attributes["compression"][1] for part in parts):
        raise ValueError("its header is damaged")
    return ExrHeader(flags, tuple(parts), file.tell())


def without_colours(data: bytes) -> bytes:
    """Return the bytes of a file, or of none, in which no decoder finds the attributes of `COLOURS`."""
    with contextlib.suppress(ValueError):
        size = read_header(io.BytesIO(data)).size
        for name, kind in COLOURS.items():
            # The length stays, and with it all offsets.
            hidden = (f"~{name[1:]}\0{kind}\0").encode()
            data = data[:size].replace(f"{name}\0{kind}\0".encode(), hidden) + data[size:]
    return data


def depth_channel(header: ExrHeader) -> Channel | None:
    """Find the channel that holds depth, by its name and that of its layer.

    None for a file of one layer without a name for depth: its grey pixels count. Raises LayerError if no
    layer holds depth, or several do.
    """
    ranks = {each: rank for each in header.channels if (rank := _depth_rank(each, header)) is not None}
    found = [each for each, rank in ranks.items() if rank == min(ranks.values())]
    if len(found) > 1:
        # Our own export has what lies behind silhouettes in another layer.
        found = [each for each in found if each.layer == "front.depth"] or found
    if len(found) == 1:
        return found[0]
    if found:
        raise LayerError(f"it has depth in several layers, {listed(found)}; save one of them alone")
    if header.has_layers:
        raise LayerError(f"it has no layer Depth and no channel Z, but {listed(header.channels)}")
    return None


def _depth_rank(channel: Channel, header: ExrHeader) -> int | None:
    """How surely a channel holds depth, 0 before 1; None where it does not."""
    leaves = [
        each.leaf for each in header.channels if (each.part, each.layer) == (channel.part, channel.layer)
    ]
    word = channel.layer.rpartition(".")[2]
    if {"x", "y"} <= set(leaves) or "mist" in word:
        # A position, a normal or a motion; or fog.
        return None
    if channel.leaf in ("z", "depth"):
        return 0 if word in ("", "z", "depth") else 1
    if "depth" in word and channel.leaf == next((leaf for leaf in VALUES if leaf in leaves), None):
        return 0 if word == "depth" else 1
    return None


def listed(channels: Sequence[Channel]) -> str:
    """List channels for a message."""
    return ", ".join(each.label for each in channels[:MOST_LISTED]) + " ..." * (len(channels) > MOST_LISTED)


def alone(data: bytes, header: ExrHeader, channel: Channel) -> bytes:
    """Make a file's bytes into those of one in which a decoder of one layer finds a channel.

    It has the channel's part, in which other channels have names of no meaning. Raises LayerError for a
    compression that depends on names, and ValueError for an incomplete file.
    """
    part = header.parts[channel.part]
    channels, compression = part.channels, part.attributes["compression"][1][0]
    if len(channels) > 1 and compression in DWA:
        raise LayerError("its layers are compressed together with DWA; save it with ZIP")
    renamed = _renamed(list(channels), channel.name)
    held = zip(renamed, channels.values(), strict=True)
    kept = {name: value for name, value in part.attributes.items() if name not in OF_PARTS}
    kept["channels"] = b"chlist", b"".join(name.encode() + b"\0" + what for name, what in held) + b"\0"
    is_tiled = bool(header.flags & TILED) or part.attributes.get("type", (b"", b""))[1].startswith(b"tiled")
    start = header_bytes(kept, renamed, TILED * is_tiled)
    chunks = _chunks(data, header, channel.part, is_tiled)
    sizes = np.array([len(chunk) for chunk in chunks], np.uint64)
    first = len(start) + 8 * len(chunks)
    offsets = first + np.concatenate([[0], np.cumsum(sizes)[:-1]])
    return start + offsets.astype("<u8").tobytes() + b"".join(chunks)


def header_bytes(
    attributes: dict[str, tuple[bytes, bytes]], channels: Sequence[str], flags: int = 0
) -> bytes:
    """Return the bytes of a header of one part.

    Args:
        attributes: Type and value by name.
        channels: Names of the channels, which may need a flag.
        flags: Other flags.
    """
    if any(len(name.encode()) > SHORT_NAME for name in [*channels, *attributes]):
        flags |= LONG_NAMES
    held = (
        name.encode() + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value
        for name, (kind, value) in attributes.items()
    )
    return MAGIC + struct.pack("<i", VERSION | flags) + b"".join(held) + b"\0"


def _renamed(names: list[str], wanted: str) -> list[str]:
    """Channel names without a layer; a single wanted one keeps its name, others become Y, read as grey."""
    if len(names) == 1:
        return [wanted.rpartition(".")[2]]
    place = names.index(wanted)
    return [
        "Y" if at == place else f"{'!' if at < place else 'Y'}~{at:04d}" for at in range(len(names))
    ]  # fmt: skip


def _chunks(data: bytes, header: ExrHeader, number: int, is_tiled: bool) -> list[memoryview]:
    """The chunks of a part in the order of its table, without the part's number."""
    view, at = memoryview(data), header.size
    is_multi = bool(header.flags & MULTI_PART)
    if is_multi:
        counts = [int.from_bytes(part.attributes["chunkCount"][1], "little") for part in header.parts]
        at += 8 * sum(counts[:number])
        offsets = np.frombuffer(data, "<u8", counts[number], at).tolist()
    else:
        # The first chunk follows the table.
        offsets, first = list[int](), len(data)
        while at < first:
            offsets.append(int.from_bytes(data[at : at + 8], "little"))
            first, at = min(first, offsets[-1]), at + 8
    found, before = [], 4 * is_multi
    for offset in offsets:
        begin = offset + before
        end = begin + 4 * (4 if is_tiled else 1)
        if offset < header.size or end + 4 > len(data):
            raise ValueError("it is incomplete")
        end += 4 + int.from_bytes(view[end : end + 4], "little")
        if not begin < end <= len(data):
            raise ValueError("it is incomplete")
        found.append(view[begin:end])
    return found


def placed(pixels: NDArray[np.float32], part: Part) -> NDArray[np.float32]:
    """Place the pixels of a data window (h, w, 3 or 4) in the display window (H, W, 3 or 4).

    Pixels outside the data window are 0 and transparent; those outside the display window are cut off.
    """
    data, display = part.data_window, part.display_window
    if data == display:
        return pixels
    size = display[3] - display[1] + 1, display[2] - display[0] + 1
    if min(size) < 1 or size[0] * size[1] > MOST_PIXELS:
        raise ValueError(f"its display window is {size[1]}x{size[0]} pixels")
    if pixels.shape[2] == 3:
        pixels = np.concatenate([pixels, np.ones((*pixels.shape[:2], 1), np.float32)], axis=2)
    whole = np.zeros((*size, 4), np.float32)
    left, top = max(data[0], display[0]), max(data[1], display[1])
    right, bottom = min(data[2], display[2]), min(data[3], display[3])
    if left <= right and top <= bottom:
        inner = pixels[top - data[1] : bottom + 1 - data[1], left - data[0] : right + 1 - data[0]]
        whole[top - display[1] : bottom + 1 - display[1], left - display[0] : right + 1 - display[0]] = inner
    return whole


def _attributes(file: BinaryIO) -> dict[str, tuple[bytes, bytes]]:
    found = dict[str, tuple[bytes, bytes]]()
    while name := _string(file):
        kind, size = _string(file), int.from_bytes(file.read(4), "little")
        if size > MOST_BYTES or len(value := file.read(size)) < size:
            raise ValueError("its header is damaged")
        found[name.decode()] = kind, value
    return found


def _string(file: BinaryIO) -> bytes:
    found = b""
    while (byte := file.read(1)) != b"\0":
        found += byte
        if not byte or len(found) > LONGEST_NAME:
            raise ValueError("its header is damaged")
    return found


def _box(value: bytes) -> Window:
    if len(value) != 16:
        raise ValueError("its header is damaged")
    left, top, right, bottom = struct.unpack("<4i", value)
    return left, top, right, bottom
