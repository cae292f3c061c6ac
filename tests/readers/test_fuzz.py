"""A thousand mutations of a small valid model in every format: each is a sound model or a UserError.

Each format is read in a process of its own, so that a crash is a failure and the peak of its memory is the
readers' own.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.core.camera.reconstruction import Reconstruction
from addon.core.readers import READERS
from addon.core.readers.matching import Imported, match

from .. import foreign_models as foreign
from .small_models import CLIP, models

resource = pytest.importorskip("resource", reason="memory and time are only limited on POSIX systems")

MUTATIONS = 1000
MEMORY = 2**30
"""Bytes that the process may have at its peak, and address space that reading may take on top."""
SECONDS = 2.0
"""Of the process's own time for one reading, so that a busy machine fails nothing."""
HUNG = 300
"""Seconds after which a process hangs where no signal is heard."""
ROOT = Path(__file__).resolve().parents[2]
WORDS = [
    b"nan", b"inf", b"-inf", b"-1", b"0", b"2147483648", b"9223372036854775808", b"18446744073709551615",
    b"4294967295", b"1e308", b"-1e308", b"1e-320", b"", b"word", b"1,5", b"0x10", b"1_0", b"9" * 5000,
    b"\xff\xfe",
]  # fmt: skip
COUNTS = [b"1000000000", b"2147483647", b"99999999999999999999", b"-5", b"1e9", b"3.5"]
INTEGERS = [2**31 - 1, 2**31, 2**32 - 1, 2**33, 2**40, 2**63, 2**64 - 1]

Mutation = Callable[[random.Random, bytes], bytes]


def truncated(rng: random.Random, data: bytes) -> bytes:
    return data[: rng.randrange(len(data))]


def flipped(rng: random.Random, data: bytes) -> bytes:
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 8, 64])):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def overwritten(rng: random.Random, data: bytes) -> bytes:
    out = bytearray(data)
    at, length = rng.randrange(len(out)), rng.choice([1, 4, 8, 50])
    out[at : at + length] = rng.choice([b"\0" * length, b"\xff" * length, rng.randbytes(length)])
    return bytes(out)


def line_repeated(rng: random.Random, data: bytes) -> bytes:
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    return b"\n".join([*lines[:at], *[lines[at]] * rng.choice([2, 3, 500]), *lines[at + 1 :]])


def line_lost(rng: random.Random, data: bytes) -> bytes:
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    return b"\n".join(lines[:at] + lines[at + rng.choice([1, 1, 2, 10]) :])


def lines_swapped(rng: random.Random, data: bytes) -> bytes:
    lines = data.split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]
    return b"\n".join(lines)


def word_replaced(rng: random.Random, data: bytes, among: list[bytes] = WORDS) -> bytes:
    lines = data.split(b"\n")
    for _ in range(rng.choice([1, 1, 1, 3])):
        at = rng.randrange(len(lines))
        words = lines[at].split(b" ")
        words[rng.randrange(len(words))] = rng.choice(among)
        lines[at] = b" ".join(words)
    return b"\n".join(lines)


def count_replaced(rng: random.Random, data: bytes) -> bytes:
    """A hostile number in place of a whole one, of which most are counts or indices."""
    words = data.split(b" ")
    whole = [index for index, word in enumerate(words) if word.isdigit()]
    lines = data.split(b"\n")
    alone = [index for index, line in enumerate(lines) if line.strip().isdigit()]
    if alone and rng.random() < 0.5:
        lines[rng.choice(alone)] = rng.choice(COUNTS)
        return b"\n".join(lines)
    if not whole:
        return word_replaced(rng, data, COUNTS)
    words[rng.choice(whole)] = rng.choice(COUNTS)
    return b" ".join(words)


def line_ends_changed(rng: random.Random, data: bytes) -> bytes:
    plain = data.replace(b"\r\n", b"\n")
    return plain.replace(b"\n", rng.choice([b"\r\n", b"\r", b"\n\n", b"\n\r", b" ", b"\x85", b"\x0b"]))


def spoilt(rng: random.Random, data: bytes) -> bytes:
    at = rng.randrange(len(data))
    added = rng.choice(
        [b"\0", b"\xef\xbb\xbf", b"\n", b" ", b"#", b"-", b"\x1a", b"9" * 20, rng.randbytes(30)]
    )
    return data[:at] + added + data[at:]


def decimals_changed(rng: random.Random, data: bytes) -> bytes:
    return data.replace(b".", rng.choice([b",", b"", b"..", b". "]))


def moved(rng: random.Random, data: bytes) -> bytes:
    a, b, c = sorted(rng.randrange(len(data)) for _ in range(3))
    return data[:a] + data[b:c] + data[a:b] + data[c:]


def integer_replaced(rng: random.Random, data: bytes) -> bytes:
    """A hostile little-endian integer of 4 or 8 bytes, as likely as not at the beginning."""
    out = bytearray(data)
    at = rng.choice([0, rng.randrange(len(out))])
    length = rng.choice([4, 8])
    out[at : at + length] = (rng.choice(INTEGERS) % 2 ** (8 * length)).to_bytes(length, "little")
    return bytes(out)


def float_replaced(rng: random.Random, data: bytes) -> bytes:
    out = bytearray(data)
    at = rng.randrange(len(out))
    value = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-320, 0.0, -1.0])
    out[at : at + 8] = np.float64(value).tobytes()
    return bytes(out)


IN_TEXT: list[Mutation] = [
    truncated, flipped, overwritten, line_repeated, line_lost, lines_swapped, word_replaced, word_replaced,
    word_replaced, count_replaced, count_replaced, line_ends_changed, spoilt, decimals_changed, moved,
]  # fmt: skip
IN_BINARY: list[Mutation] = [
    truncated, truncated, flipped, overwritten, spoilt, moved, integer_replaced, integer_replaced,
    integer_replaced, float_replaced,
]  # fmt: skip


def read(folder: Path, label: str) -> Imported:
    """With the format's own reader, whether or not it still recognises the file."""
    reader = next(reader for reader in READERS if label.startswith(reader.FORMAT.split()[0]))
    whole = label.startswith(("COLMAP", "Stray"))
    path = folder if whole else folder / next(iter(models()[label]))
    reader.recognises(path)
    return reader.read(path, foreign.SIZE)


class HungError(Exception):
    """Reading took longer than it may."""


@contextmanager
def limits() -> Iterator[None]:
    """No more memory than `MEMORY` on top; `HungError` when the timer that is set for a reading runs out."""

    def hung(number: int, frame: FrameType | None) -> None:
        raise HungError

    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, before[1]))
    handler = signal.signal(signal.SIGVTALRM, hung)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, handler)
        resource.setrlimit(resource.RLIMIT_AS, before)


def assert_sound(model: Reconstruction, frames: Container[int]) -> None:
    """Everything finite, of the promised types and in range."""
    points = len(model.points)
    assert points == len(model.points.rgb) == len(model.points.error)
    assert model.points.rgb.dtype == np.uint8
    for array in (model.points.xyz, model.points.error):
        assert array.dtype == np.float64
        assert np.isfinite(array).all()
    for lens in model.cameras:
        assert lens.width > 0
        assert lens.height > 0
        values = lens.parameters()[1]
        assert np.isfinite(values).all()
        assert min(lens.fx, lens.fy) > 0
    assert len({image.frame for image in model.images}) == len(model.images)
    for image in model.images:
        assert image.frame in frames
        assert 0 <= image.camera < len(model.cameras)
        np.testing.assert_allclose(image.rotation @ image.rotation.T, np.eye(3), atol=1e-6)
        assert np.isfinite(image.translation).all()
        assert image.xy.shape == (len(image.points), 2)
        assert np.isfinite(image.xy).all()
        assert image.points.dtype == np.int32
        assert len(image.points) == 0 or (image.points.min() >= 0 and image.points.max() < points)


def peak() -> int:
    """Bytes of memory that this process has had at most; getrusage would count its parent's, too."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def write(path: Path, content: bytes) -> None:
    """Into a new file: some file systems go to the disk at once when one that is there is overwritten."""
    path.unlink(missing_ok=True)
    path.write_bytes(content)


def fuzz(label: str, folder: Path) -> int:
    """Read every mutation of a format in a folder; how many were refused."""
    files = models()[label]
    for name, content in files.items():
        write(folder / name, content)
    match(read(folder, label), CLIP)

    rng = random.Random(f"{label} 1")
    refused = 0
    with limits():
        for number in range(MUTATIONS):
            name = rng.choice(list(files))
            mutate = rng.choice(IN_BINARY if name.endswith((".bin", ".npz", ".r3d")) else IN_TEXT)
            content = mutate(rng, files[name])
            write(folder / name, content)
            signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
            try:
                found = read(folder, label)
                assert_sound(found.reconstruction, range(len(found.names)))
                assert_sound(match(found, CLIP).reconstruction, CLIP.frames)
            except UserError as error:
                refused += 1
                assert str(error)
                assert "\n" not in str(error)
                assert len(str(error)) < 1000
            except BaseException as error:
                error.add_note(f"{label}, mutation {number} ({mutate.__name__}) of {name}")
                raise
            finally:
                signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            write(folder / name, files[name])
    return refused


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is limited through Linux's /proc")
@pytest.mark.parametrize("label", models())
def test_every_mutation_is_a_sound_model_or_a_user_error(tmp_path: Path, label: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.readers.test_fuzz", label, str(tmp_path)],
        cwd=ROOT, capture_output=True, text=True, timeout=HUNG,
    )  # fmt: skip
    assert done.returncode == 0, f"status {done.returncode}: {done.stderr}"
    said = json.loads(done.stdout)
    refused, most = said["refused"], said["peak"]
    print(
        f"\n{label}: {refused} of {MUTATIONS} mutations refused, {MUTATIONS - refused} read as sound models;"
        f" peak memory {most / 2**20:.0f} MiB, {said['more'] / 2**20:.0f} MiB of it by reading"
    )
    # Some damage does not show, as in a comment; most must.
    assert refused > MUTATIONS // 3
    assert most < MEMORY


if __name__ == "__main__":
    before = peak()
    count = fuzz(sys.argv[1], Path(sys.argv[2]))
    print(json.dumps({"refused": count, "peak": peak(), "more": peak() - before}))
