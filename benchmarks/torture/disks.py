"""Disks that are full: nothing that was cut off is called written; with space the same command goes on."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .bench import FRAMES, LENS, Try, contents, file_limit


def file_size(one: Try) -> None:
    """No file can grow beyond a size, for frames or a movie."""
    is_movie = one.dice.random() < 0.5
    out, expected = _output(one, one.folder / "out", is_movie)
    size = int(max(map(len, expected.values())) * one.dice.uniform(0, 1.05))
    words = ("render", one.bench.work, *LENS, "--out", out)
    run = one.run(*words, limits=file_limit(size))
    if run.status == 0 and any(contents(out.parent).get(name) != data for name, data in expected.items()):
        one.verdict.add("wrong", f"a file limit of {size} bytes: {run.said[-300:]}")
    one.check_partial(expected, out.parent)
    again = ("--overwrite",) if out.exists() else ()
    one.expect(expected, out, one.run(*words, *again))


def small_disk(one: Try) -> None:
    """A disk of a few kilobytes; later it has space."""
    is_movie = one.dice.random() < 0.5
    with _disk(one.folder / "disk") as disk:
        if disk is None:
            one.verdict.note = "no disk can be mounted here"
            return
        out, expected = _output(one, disk / "out", is_movie)
        need = sum(map(len, one.bench.frames.values()))
        _resize(disk, int(need * one.dice.uniform(0.05, 1.6)))
        words = ("render", one.bench.work, *LENS, "--out", out)
        run = one.run(*words)
        there = contents(out.parent)
        if run.status == 0 and any(there.get(name) != data for name, data in expected.items()):
            one.verdict.add("wrong", f"status 0 on a full disk: {run.said[-300:]}")
        one.check_partial(expected, out.parent)
        _resize(disk, 64 << 20)
        again = ("--overwrite",) if out.exists() else ()
        one.expect(expected, out, one.run(*words, *again))


def saving(one: Try) -> None:
    """No space for a .blend or its archive."""
    blend = one.folder / "out" / "a.blend"
    words = ("save", one.bench.work, *LENS, "--blend", blend, "--pack")
    size = int(one.dice.uniform(0, 1) * 600_000)
    run = one.run(*words, limits=file_limit(size))
    there = contents(blend.parent)
    if run.status == 0 and not {"a.blend", "a.zip", "clip.mp4"} <= set(there):
        one.verdict.add("wrong", f"saved with a file limit of {size} bytes")
    if any(len(data) >= size for data in there.values()) and size:
        one.verdict.add("wrong", "a file that was cut off is there")
    again = one.run(*words, "--overwrite")
    if again.status:
        one.verdict.add("lost", again.said[-300:])
    one.look_for_leftovers({"a.blend", "a.zip", "clip.mp4"}, set(contents(blend.parent)))


def keeping_depth(one: Try) -> None:
    """No space for the depth that is to be kept, or less than it takes by the user's limit: what is called
    kept is there, and with space the same command goes on."""
    work = one.bench.project(one.folder / "project")
    kind = one.dice.choice(["disk", "limit", "file"])
    if kind == "file":
        (work / "depth").touch()
    limits = file_limit(one.dice.choice([0, 500, 4000])) if kind == "disk" else None
    most = {"VIRTUAL_APERTURE_KEPT_DEPTH": str(one.dice.randint(1, 200_000))} if kind == "limit" else {}
    run = one.end(one.start("depth", work, limits=limits, environment=most))
    there = len(list(work.glob("depth/*/depth-*.npz")))
    if run.status == 0 and there < FRAMES:
        one.verdict.add("wrong", f"{kind}: {there} are kept: {run.said[-300:]}")
    # Where nothing can be written at all, it does not begin.
    messages = (
        f"the depth of {there} of {FRAMES} frames is kept",
        "no folder for temporary files can be written",
    )
    if run.status and not any(each in run.said for each in messages[: 1 if there else 2]):
        one.verdict.add("wrong", f"{kind}: {there} are kept: {run.said[-300:]}")
    if kind == "file":
        (work / "depth").unlink()
    again = one.run("depth", work)
    if again.status or len(list(work.glob("depth/*/depth-*.npz"))) != FRAMES:
        one.verdict.add("lost", f"with space: {again.said[-300:]}")
    one.look_for_leftovers(set(), {name for name in contents(work) if ".part-" in name})


def _output(one: Try, folder: Path, is_movie: bool) -> tuple[Path, dict[str, bytes]]:
    name = "a.mp4" if is_movie else "####.png"
    return folder / name, {"a.mp4": one.bench.movie} if is_movie else one.bench.frames


@contextmanager
def _disk(folder: Path) -> Iterator[Path | None]:
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64m", "torture", str(folder)]
    try:
        done = subprocess.run(mount, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        done = False
    if not done:
        yield None
        return
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


def _resize(disk: Path, size: int) -> None:
    subprocess.run(["mount", "-o", f"remount,size={max(size, 1 << 14)}", str(disk)], check=True)
