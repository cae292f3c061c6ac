"""Rendered pictures and movies on disk: verified by reading, each still with the key of all its inputs.

The key is in the picture's metadata (Blender's stamp note), so a file never describes another one, several
processes can write into one folder, and a moved or copied file keeps its key. A digest of the file's other
bytes is there, too: programs that edit pictures keep such notes.
"""

import hashlib
import re
import zlib
from collections.abc import Sequence
from pathlib import Path

import bpy
import cv2
import imbuf
import numpy as np
from numpy.typing import NDArray

from ...core.base.counting import ranges
from ...core.base.digest import code_digest
from ...core.base.errors import UserError
from ...core.base.regular_file import open_regular, read_regular, regular_stat
from ...core.media.clip_identity import clip_digest
from ...core.media.picture_file import Pixels, read_picture
from ...core.media.video import VideoReader, video_info
from ...scene.base.timeline import go_to
from ...scene.lens.lens import frame_options
from ...scene.sources.shot import shot_of
from ..views.frame_size import render_size, written_size

HEADER = 1 << 16
"""Bytes of a file in which its metadata is looked for; Blender writes it before the pixels."""
RATE_ERROR = 1e-6
"""Relative error of a movie's times: Blender keeps a rate's base in single precision."""
COMPARED = 24
"""Pictures of a movie that are compared with those it was made of: each takes a PNG and up to 18 frames."""
ALIKE = 0.05
"""Largest mean difference of levels, of 1, of a picture and its movie frame averaged over 8x8 fields."""
_PNG = b"\x89PNG\r\n\x1a\n"
_EBML, _SEGMENT = b"\x1a\x45\xdf\xa3", b"\x18\x53\x80\x67"
"""Identifiers of the two elements that a Matroska file is made of."""
_CRC = 4
"""Bytes of the checksum behind a PNG's chunk."""
_NOTE = re.compile(rb"virtual-aperture-frame ([0-9a-f]{64}) ([0-9a-f]{64})")
_UNSEALED = "0" * 64
ROOMS = "core", "scene", "render"
"""Folders of the add-on whose code pictures depend on: a run that goes on mixes none of other code."""
GRADED = "virtual_aperture_run"
"""Property of a scene with other influences on the pictures, such as the compositor or CG objects. They have
no digest, so the property identifies the run, or file."""


def note_of(key: str) -> str:
    """Return the stamp note that carries a key (64 hexadecimal digits), with room for `seal`'s digest."""
    return f"virtual-aperture-frame {key} {_UNSEALED}"


def seal(path: Path) -> None:
    """Write the digest of a whole picture into its note. UserError where it has no note; raises OSError."""
    data = path.read_bytes()
    note = _NOTE.search(data, 0, HEADER)
    if note is None:
        raise UserError(f"{path.name} was written without its metadata; render it again")
    sealed = _digest(data, note).encode()
    if data.startswith(_PNG):
        chunk = data.rindex(b"tEXt", 0, note.start())
        sealed += zlib.crc32(data[chunk : note.start(2)] + sealed).to_bytes(_CRC)
    with path.open("r+b") as file:
        file.seek(note.start(2))
        file.write(sealed)


def key_of(path: Path) -> str | None:
    """Return the key in a picture's metadata, None without one; UserError if it is not a file."""
    found = _NOTE.search(_read(path, HEADER))
    return found[1].decode() if found else None


def is_changed(path: Path) -> bool:
    """Return whether a picture with a key was changed since it was written; all of it is read.

    Raises:
        UserError: It cannot be read.
    """
    data = _read(path)
    note = _NOTE.search(data, 0, HEADER)
    return note is not None and note[2].decode() != _digest(data, note)


def _read(path: Path, most: int = -1) -> bytes:
    try:
        with open_regular(path) as file:
            return file.read(most)
    except OSError as error:
        raise UserError(f"{path} cannot be read: {error.strerror}") from None


def _digest(data: bytes, note: re.Match[bytes]) -> str:
    """64 hexadecimal digits of a picture without those digits, and without their own checksum in a PNG."""
    behind = note.end() + (_CRC if data.startswith(_PNG) else 0)
    digest = hashlib.blake2b(data[: note.start(2)], digest_size=32)
    digest.update(memoryview(data)[behind:])
    return digest.hexdigest()


def still_problem(path: Path, size: tuple[int, int] | None = None) -> str:
    """Return the reason why a picture is not usable, or "": it is decoded completely.

    `size` is the expected (width, height).
    """
    try:
        if regular_stat(path).st_size == 0:
            return "is empty"
        found = _exr_size(path) if path.suffix.lower() == ".exr" else _png_size(path)
    except FileNotFoundError:
        return "was not written"
    except (OSError, ValueError, RuntimeError, cv2.error) as error:
        return f"cannot be read back ({error})"
    if found is None:
        return "is cut off or damaged"
    if size is not None and found != size:
        return f"is {found[0]}x{found[1]} and should be {size[0]}x{size[1]}"
    return ""


def movie_problem(path: Path, count: int, size: tuple[int, int], rate: float = 0.0) -> str:
    """Return the reason why a movie (.mp4, .mov or .mkv) is incomplete, or "".

    Its frames are decoded, counted, and with a `rate`, in frames a second, they must have its times. A full
    disk can cut off the last bytes, behind all frames.
    """
    if not path.exists():
        return "was not written"
    try:
        movie = video_info(path)
    except UserError as error:
        return f"cannot be read back ({error})"
    found = movie.count - len(movie.damaged)
    if found != count:
        return f"has {found} frames that can be decoded and should have {count}"
    whole = _has_whole_segment if path.suffix.lower() == ".mkv" else _has_whole_boxes
    if not whole(path):
        return "is cut off"
    if rate:
        off = np.abs(movie.seconds - np.arange(count) / rate)
        late = np.flatnonzero(off > movie.tick[0] / movie.tick[1] + RATE_ERROR * movie.seconds)
        if late.size or not movie.is_timed:
            at = late[0] if late.size else 0
            return f"shows frame {at + 1} at {movie.seconds[at]:.6g} s and should at {at / rate:.6g} s"
    held = movie.width, movie.height
    return "" if held == size else f"is {held[0]}x{held[1]} and should be {size[0]}x{size[1]}"


def shown_problem(path: Path, files: dict[int, Path], held: Sequence[int], size: tuple[int, int]) -> str:
    """Return the reason why a movie does not show pictures, by frame, in the order of frames `held`, or "".

    Each picture must have its place; `COMPARED` of them are compared, but those of light (EXR).
    """
    places = {frame: number for number, frame in reversed(list(enumerate(held, 1)))}
    if lost := sorted(files.keys() - places.keys()):
        return f"has no place for rendered frames {ranges(lost)}, and each should be there"
    reader = VideoReader(path, size)
    try:
        for at in np.unique(np.linspace(0, len(files) - 1, COMPARED).round().astype(int)):
            frame = sorted(files)[at]
            if files[frame].suffix.lower() != ".png":
                return ""
            shown, meant = _thumbnail(reader.read(places[frame])), _thumbnail(read_picture(files[frame]))
            if np.abs(shown - meant).mean() > ALIKE:
                return f"shows another picture at frame {places[frame]} and should show {files[frame].name}"
    finally:
        reader.close()
    return ""


def _thumbnail(picture: Pixels) -> NDArray[np.float32]:
    """A picture's levels (8, 8, 3), in [0, 1]."""
    scaled = cv2.resize(picture[..., :3], (8, 8), interpolation=cv2.INTER_AREA)
    return np.asarray(scaled / (255 if picture.dtype == np.uint8 else 65535), np.float32)


def _has_whole_boxes(path: Path) -> bool:
    """Return whether an MP4 or QuickTime file ends with its last box (ISO/IEC 14496-12)."""
    size, at = path.stat().st_size, 0
    with open_regular(path) as file:
        while at + 8 <= size:
            file.seek(at)
            head = file.read(16)
            length = int.from_bytes(head[:4])
            if length == 1:
                length = int.from_bytes(head[8:])
            if length < 8:
                return False
            at += length
    return at == size


def _has_whole_segment(path: Path) -> bool:
    """Return whether a Matroska file ends with its segment (RFC 8794 and 9559)."""
    with open_regular(path) as file:
        data = file.read(HEADER)
    at = 0
    for element in (_EBML, _SEGMENT):
        at += len(element)
        if data[at - len(element) : at] != element or at >= len(data) or not data[at]:
            return False
        # The leading zeros of the first byte give the number of bytes of the length.
        digits = 9 - data[at].bit_length()
        length = int.from_bytes(data[at : at + digits]) & ((1 << 7 * digits) - 1)
        at += digits
        if element == _EBML:
            at += length
    return at + length == path.stat().st_size


def refuse(path: Path, problem: str) -> None:
    """Raise UserError where a file that was just written has a problem."""
    if problem:
        raise UserError(f"{path.name} {problem} and was discarded{likely_cause(problem)}")


def likely_cause(problem: str) -> str:
    """Return the end of a message about a file that was just written and is not right.

    A picture of another size is whole: no disk is full then.
    """
    return "" if "should be" in problem else "; is the disk full? Free some space and render again"


def _png_size(path: Path) -> tuple[int, int] | None:
    data = read_regular(path)
    if not _has_whole_chunks(data):
        return None
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    finally:
        cv2.utils.logging.setLogLevel(level)
    return None if picture is None else (picture.shape[1], picture.shape[0])


def _has_whole_chunks(data: bytes) -> bool:
    """Whether the chunks of a PNG agree with their checksums, to its end; decoders take wrong ones."""
    at, kind = len(_PNG), b""
    if data[:at] != _PNG:
        return False
    while at + 12 <= len(data) and kind != b"IEND":
        length = int.from_bytes(data[at : at + 4])
        kind, end = data[at + 4 : at + 8], at + 8 + length
        if zlib.crc32(data[at + 4 : end]) != int.from_bytes(data[end : end + 4]):
            return False
        at = end + 4
    return kind == b"IEND" and at == len(data)


def _exr_size(path: Path) -> tuple[int, int] | None:
    image = imbuf.load(str(path))
    if image is None:
        return None
    width, height = image.size
    image.free()
    return width, height


def set_no_stamps(render: bpy.types.RenderSettings) -> None:
    """Remove times and paths from the output: equal pictures must be equal files."""
    for name in [name for name in dir(render) if name.startswith("use_stamp")]:
        setattr(render, name, False)


def blender_path(path: Path) -> str:
    """Return a path as Blender's output setting takes it: braces are templates, two slashes the folder."""
    text = str(path.absolute()).replace("{", "{{").replace("}", "}}")
    return "/" + text.lstrip("/") if text.startswith("//") else text


def run_key(scene: bpy.types.Scene) -> str:
    """Return 64 hexadecimal digits of all inputs of a clip's pictures that are common to its frames.

    A keyed lens is that of the clip's first frame, which is shown.
    """
    return _with_lens(scene, _clip_key(scene), shot_of(scene).footage.frames[0])


def frame_keys(scene: bpy.types.Scene, frames: list[int]) -> dict[int, str]:
    """Return 64 hexadecimal digits of all inputs of each frame's picture. The frames are shown."""
    key = _clip_key(scene)
    return {frame: _with_lens(scene, f"{key} {frame}", frame) for frame in frames}


def _clip_key(scene: bpy.types.Scene) -> str:
    """The key of all inputs but the lens."""
    shot = shot_of(scene)
    maps = shot.depth and (clip_digest(shot.depth.maps.pictures.path), shot.depth.fit.line.tolist())
    parts = (
        code_digest(*ROOMS), clip_digest(shot.footage.path), shot.clip_digests, shot.mask_digests,
        maps, shot.working, render_size(scene.render), written_size(scene.render),
        scene.get(GRADED),
    )  # fmt: skip
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _with_lens(scene: bpy.types.Scene, key: str, frame: int) -> str:
    """A key together with the lens at a frame: its settings may be keyed."""
    go_to(scene, frame)
    lens = frame_options(scene.virtual_aperture, shot_of(scene).reconstruction)
    return hashlib.sha256(f"{key} {lens!r}".encode()).hexdigest()
