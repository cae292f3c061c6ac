"""Ends at random moments: the next run finishes what was begun, to the bit."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

from . import clip
from .bench import LENS, Run, Try, contents

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
STATUS = {signal.SIGTERM: 143, signal.SIGINT: 130}
GRACE = 15.0
"""Seconds after which processes must be gone whose parent was killed."""
LONG = 2000
"""Frames of a long clip."""


def interrupt(one: Try, process: subprocess.Popen[str], seconds: float, number: signal.Signals) -> Run:
    """Send a signal after a while; a process that hears it must say so by its status."""
    time.sleep(seconds)
    process.send_signal(number)
    run = one.end(process, expected={number})
    if number in STATUS and run.status not in (0, STATUS[number], -number):
        one.verdict.add("wrong", f"{number.name} ended with {run.status}: {run.said[-300:]}")
    return run


def moment(one: Try) -> float:
    """Mostly while frames are drawn, sometimes while the program starts."""
    return one.dice.uniform(0.2, 1.1) * one.bench.seconds


def frames(one: Try) -> None:
    """A sequence."""
    out = one.folder / "out" / "####.png"
    words = ("render", one.bench.work, *LENS, "--out", out)
    for _ in range(one.dice.randint(1, 2)):
        interrupt(one, one.start(*words), moment(one), one.dice.choice(SIGNALS))
        one.check_partial(one.bench.frames, out.parent)
    kept = contents(out.parent)
    one.expect(one.bench.frames, out, one.run(*words))
    after = contents(out.parent)
    if any(after.get(name) != kept[name] for name in kept if name in one.bench.frames):
        one.verdict.add("lost", "a finished frame was changed")


def movie(one: Try) -> None:
    """A movie."""
    out = one.folder / "out" / "a.mp4"
    words = ("render", one.bench.work, *LENS, "--out", out)
    run = interrupt(one, one.start(*words), moment(one) * 1.2, one.dice.choice(SIGNALS))
    one.check_partial({"a.mp4": one.bench.movie}, out.parent)
    if run.status == 0 or out.exists():
        one.expect({"a.mp4": one.bench.movie}, out, one.run(*words, "--overwrite"))
        return
    one.expect({"a.mp4": one.bench.movie}, out, one.run(*words))


def overwriting(one: Try) -> None:
    """A sequence that replaces one of another lens: never a mixture that is called done."""
    out = one.folder / "out" / "####.png"
    out.parent.mkdir()
    for name, data in one.bench.others.items():
        (out.parent / name).write_bytes(data)
    words = ("render", one.bench.work, *LENS, "--out", out)
    interrupt(one, one.start(*words, "--overwrite"), moment(one), one.dice.choice(SIGNALS))
    for name, data in contents(out.parent).items():
        if name in one.bench.frames and data not in (one.bench.frames[name], one.bench.others[name]):
            one.verdict.add("wrong", f"{name} is of neither lens")
    run = one.run(*words)
    if run.status == 0 and contents(out.parent) != one.bench.frames:
        one.verdict.add("wrong", "old frames were kept as if they were this run's")
    one.expect(one.bench.frames, out, one.run(*words, "--overwrite"))


def jobs(one: Try) -> None:
    """Several processes: one of them, or the one that started them."""
    is_movie = one.dice.random() < 0.5
    out = one.folder / "out" / ("a.mp4" if is_movie else "####.png")
    expected = {"a.mp4": one.bench.movie} if is_movie else one.bench.frames
    words = ("render", one.bench.work, *LENS, "--out", out)
    process = one.start(*words, "--jobs", 2)
    time.sleep(one.dice.uniform(0.8, 2.5) * one.bench.seconds)
    children = _children(process.pid)
    number = one.dice.choice(SIGNALS)
    if children and one.dice.random() < 0.5:
        _send(one.dice.choice(children), signal.SIGKILL)
        # Its share is begun once more: the run is a success all the same.
        run = one.end(process)
        if run.status:
            one.verdict.add("lost", f"a killed process was not replaced: {run.said[-300:]}")
    else:
        interrupt(one, process, 0, number)
        _expect_gone(one, children)
    one.check_partial(expected, out.parent)
    one.expect(expected, out, one.run(*words, *["--overwrite"] * is_movie))


def saving(one: Try) -> None:
    """A .blend with the clip beside it and its archive: whole or not there."""
    blend = one.folder / "out" / "a.blend"
    words = ("save", one.bench.work, *LENS, "--blend", blend, "--pack")
    interrupt(one, one.start(*words), moment(one), one.dice.choice(SIGNALS))
    if (blend.parent / "clip.mp4").exists():
        one.check_partial({"clip.mp4": one.bench.clip.read_bytes()}, blend.parent)
    run = one.run(*words, "--overwrite")
    if run.status:
        one.verdict.add("lost", run.said[-300:])
    one.look_for_leftovers({"a.blend", "a.zip", "clip.mp4"}, set(contents(blend.parent)))


def solving(one: Try) -> None:
    """A solve, into an empty folder or in place of another: the next one gives the same model, to the bit."""
    work = one.folder / "work"
    again = ["--again"] * one.dice.randrange(2)
    if again:
        shutil.copytree(one.bench.walk_work, work)
    words = ("solve", one.bench.walk, "--work", work, *again)
    seconds = one.dice.uniform(0.05, 1.1) * one.bench.solve_seconds
    interrupt(one, one.start(*words), seconds, one.dice.choice(SIGNALS))
    if again and one.run("report", work).status:
        one.verdict.add("lost", "the solve that was there is not usable while it is replaced")
    run = one.run(*words)
    if run.status:
        one.verdict.add("lost", f"the next solve ended with {run.status}: {run.said[-300:]}")
        return
    expected, there = contents(one.bench.walk_work / "model"), contents(work / "model")
    if bad := sorted(name for name in expected if there.get(name) != expected[name]):
        one.verdict.add("wrong", f"{bad} differ from the reference")
    one.look_for_leftovers({"solve.json", *(f"model/{name}" for name in expected)}, set(contents(work)))


def long(one: Try) -> None:
    """Two thousand frames, interrupted many times."""
    # Minutes on an idle machine.
    one.patience = 1800
    pictures = clip.write_pictures(one.folder / "clip", LONG)
    work = clip.solve(pictures, one.folder / "work")
    whole = one.folder / "whole" / "####.png"
    words = ("render", work, *LENS, "--out")
    began = one.run(*words, whole)
    if began.status:
        one.verdict.add("lost", began.said[-300:])
        return
    out = one.folder / "out" / "####.png"
    for _ in range(6):
        number: signal.Signals = one.dice.choice(SIGNALS)
        interrupt(one, one.start(*words, out), one.dice.uniform(0.1, 0.3) * began.seconds, number)
    one.expect(contents(whole.parent), out, one.run(*words, out))


def _children(process: int) -> list[int]:
    path = Path(f"/proc/{process}/task/{process}/children")
    try:
        return [int(each) for each in path.read_text().split()]
    except OSError:
        return []


def _send(process: int, number: signal.Signals) -> None:
    try:
        os.kill(process, number)
    except ProcessLookupError:
        return


def _expect_gone(one: Try, processes: list[int]) -> None:
    until = time.monotonic() + GRACE
    while alive := [p for p in processes if Path(f"/proc/{p}").exists() and not _is_zombie(p)]:
        if time.monotonic() > until:
            one.verdict.add("leftover", f"{len(alive)} processes go on without their parent")
            for each in alive:
                _send(each, signal.SIGKILL)
            return
        time.sleep(0.1)


def _is_zombie(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except (OSError, IndexError):
        return True
