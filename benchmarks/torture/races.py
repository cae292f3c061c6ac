"""Two at once: each that says it wrote something is right, and so is what lies there in the end."""

from __future__ import annotations

import shutil
import subprocess
import time

from . import clip
from .bench import DENSE, LENS, OTHER, Try, contents

NAMESPACE = ("unshare", "--pid", "--fork", "--mount-proc")
"""Before a command: run it with a table of processes of its own, as in a container."""


def same_frames(one: Try) -> None:
    """One sequence by two processes with the same settings."""
    out = one.folder / "out" / "####.png"
    _two(
        one, ("render", one.bench.work, *LENS, "--out", out), ("render", one.bench.work, *LENS, "--out", out)
    )
    one.expect(one.bench.frames, out, one.run("render", one.bench.work, *LENS, "--out", out))


def other_frames(one: Try) -> None:
    """One sequence by two processes with other lenses: no frame is a mixture, none is called the other's."""
    out = one.folder / "out" / "####.png"
    words = [("render", one.bench.work, *lens, "--out", out, "--overwrite") for lens in (LENS, OTHER)]
    _two(one, *words)
    for name, data in contents(out.parent).items():
        if name in one.bench.frames and data not in (one.bench.frames[name], one.bench.others[name]):
            one.verdict.add("wrong", f"{name} is of neither lens")
    one.expect(one.bench.frames, out, one.run(*words[0]))


def other_movie(one: Try) -> None:
    """One movie by two processes with other lenses: it is one of the two, and the last that wrote it."""
    out = one.folder / "out" / "a.mp4"
    words = [("render", one.bench.work, *lens, "--out", out, "--overwrite") for lens in (LENS, OTHER)]
    _two(one, *words)
    if out.exists() and out.read_bytes() not in (one.bench.movie, one.bench.other_movie):
        one.verdict.add("wrong", "the movie is neither's")
    one.expect({"a.mp4": one.bench.movie}, out, one.run(*words[0]))


def solves(one: Try) -> None:
    """Two clips' solves into one folder: it keeps one of them, whole, and the other is told."""
    models = []
    for name in ("one", "two"):
        folder = one.folder / name
        pictures = clip.write_pictures(folder / "clip", 6)
        (pictures / "0001.png").write_bytes((pictures / "0001.png").read_bytes() + name.encode())
        work = clip.solve(pictures, folder / "work")
        model = folder / "model"
        run = one.run("export", work, "--model", model)
        if run.status:
            one.verdict.add("lost", run.said[-300:])
        models.append((pictures, model))
    shared = one.folder / "shared"
    words = [("import", model, "--footage", pictures, "--work", shared) for pictures, model in models]
    statuses = _two(one, *words)
    if statuses == (0, 0):
        one.verdict.add("wrong", "both solves are called kept")
    run = one.run("report", shared)
    if run.status:
        one.verdict.add("lost", f"neither solve is kept: {run.said[-300:]}")
    shutil.rmtree(shared)


def replaced_input(one: Try) -> None:
    """The clip is replaced by another while it is rendered: no picture of both is called this run's."""
    work = one.bench.project(one.folder / "project")
    source = one.folder / "project" / "clip" / "clip.mp4"
    out = one.folder / "out" / "####.png"
    process = one.start("render", work, *LENS, "--out", out)
    time.sleep(one.dice.uniform(0.3, 1.2) * one.bench.seconds)
    other = clip.write_video(one.folder / "other", 12)
    other.replace(source)
    one.end(process)
    run = one.run("render", work, *LENS, "--out", out)
    if run.status == 0:
        one.verdict.add("wrong", "another clip was rendered with this one's solve")


def removed_input(one: Try) -> None:
    """The masks are removed while frames are rendered."""
    masks = one.folder / "masks"
    shutil.copytree(one.bench.masks, masks)
    out = one.folder / "out" / "####.png"
    words = ("render", one.bench.work, *DENSE, "--mask", masks, "--out", out)
    process = one.start(*words)
    time.sleep(one.dice.uniform(0.4, 1.0) * one.bench.seconds)
    shutil.rmtree(masks)
    run = one.end(process)
    if run.status == 0 and contents(out.parent) != one.bench.masked:
        one.verdict.add("wrong", "frames without their masks are called written")
    one.check_partial(one.bench.masked, out.parent)
    shutil.copytree(one.bench.masks, masks)
    one.expect(one.bench.masked, out, one.run(*words))


def _two(one: Try, first: tuple[object, ...], second: tuple[object, ...]) -> tuple[int, int]:
    """Run two commands at once; their statuses."""
    a = one.start(*first)
    time.sleep(one.dice.choice([0, one.dice.uniform(0, 0.6) * one.bench.seconds]))
    b = one.start(*second)
    return one.end(a).status, one.end(b).status


def another_container(one: Try) -> None:
    """A solve and a render, and a container on the same disk that looks into both folders meanwhile: it sees
    none of their processes, and leaves all of it alone."""
    if subprocess.run([*NAMESPACE, "true"], capture_output=True, check=False).returncode:
        one.verdict.note = "no namespace of processes can be made here"
        return
    work, out = one.folder / "work", one.folder / "out" / "####.png"
    solving = one.start("solve", one.bench.walk, "--work", work)
    rendering = one.start("render", one.bench.work, *LENS, "--out", out)
    for _ in range(one.dice.randint(2, 5)):
        time.sleep(one.dice.uniform(0.1, 0.5) * one.bench.solve_seconds)
        looks = [
            one.start("report", work, before=NAMESPACE),
            one.start("render", one.bench.work, *OTHER, "--frames", "3-6", "--out", out, before=NAMESPACE),
        ]
        for look in looks:
            one.end(look)
    for name, process in (("solve", solving), ("render", rendering)):
        run = one.end(process)
        # A frame of the other lens may be there first, which is refused.
        if run.status and "was replaced in the meantime" not in run.said and "other settings" not in run.said:
            one.verdict.add("lost", f"the {name} was disturbed: {run.said[-300:]}")
    expected, there = contents(one.bench.walk_work / "model"), contents(work / "model")
    if there != expected:
        one.verdict.add("wrong", "the solve differs from the reference")
    one.expect(one.bench.frames, out, one.run("render", one.bench.work, *LENS, "--out", out, "--overwrite"))
    one.look_for_leftovers({"solve.json", *(f"model/{name}" for name in expected)}, set(contents(work)))
