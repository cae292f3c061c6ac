"""A movie by processes side by side and by a farm's workers: `python -m benchmarks.special workers`.

A real clip, played forwards and backwards until it is long enough, is solved once and rendered in draft
quality: by one process, by two and so on (`--jobs`), and as an Open Job Description job whose tasks are
taken by one worker, by two and so on, each task through `openjd run` if that program is there. In the last
run one worker is killed in the middle of a task. Each run begins with nothing kept but the solve, and its
frames are compared with the first run's to the bit.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Empty, Queue
from typing import Any

from .. import store
from .first_frames import lengthened
from .real_costs import RealClip, opened
from .whole_runs import HEADLESS

CLIP = "clips/still_garden_shaky_1.mp4"
LENS = ("--focus-at", "0.5,0.5@30", "--blur", "0.03", "--quality", "draft", "--for-movie")
CHUNK = 12
KILLED_AFTER = 8.0
"""Seconds after which the first task of the last run is killed."""


def timed(run: Callable[[], None]) -> tuple[float, float]:
    """Return the wall and processor seconds of what starts processes and waits for them."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    run()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return time.perf_counter() - began, spent


def digest(frames: Path) -> str:
    """Return one digest of the names and bytes of a folder's frames."""
    found = hashlib.sha256()
    for path in sorted(frames.iterdir()):
        found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()


def tasks(job: dict[str, Any], bundle: Path) -> dict[str, list[list[str]]]:
    """Return the commands of each step as a scheduler runs them, with the bundle where it lies now."""
    values = {each["name"]: each["default"] for each in job["parameterDefinitions"]}
    values |= {name: str(bundle / values[name]) for name in ("Input", "Output")}
    found = dict[str, list[list[str]]]()
    for step in job["steps"]:
        run = step["script"]["actions"]["onRun"]
        spaces = step.get("parameterSpace", {}).get("taskParameterDefinitions")
        space = spaces[0] if spaces else {"name": "", "range": [""]}
        found[step["name"]] = commands = []
        for value in space["range"]:
            given = {f"Param.{name}": each for name, each in values.items()} | {
                f"Task.Param.{space['name']}": value
            }
            words = [run["command"], *run["args"]]
            for name, each in given.items():
                words = [word.replace(f"{{{{{name}}}}}", each) for word in words]
            commands.append(words)
    return found


def by_openjd(openjd: str, job: dict[str, Any], bundle: Path) -> list[list[str]]:
    """Return the command `openjd run` for each task that renders."""
    step = next(each for each in job["steps"] if each["name"] == "Render")
    space = step["parameterSpace"]["taskParameterDefinitions"][0]
    words = [openjd, "run", str(bundle / "template.json"), "--step", "Render", "--tasks"]
    return [[*words, json.dumps([{space["name"]: value}])] for value in space["range"]]


def worked(commands: list[list[str]], workers: int, kill: bool) -> None:
    """Run commands by so many workers; a command that fails is repeated, as a scheduler does."""
    queue: Queue[list[str]] = Queue()
    for command in commands:
        queue.put(command)

    def worker(number: int) -> None:
        kills = kill and number == 0
        while True:
            try:
                command = queue.get_nowait()
            except Empty:
                return
            quiet = subprocess.DEVNULL
            process = subprocess.Popen(command, stdout=quiet, stderr=quiet, start_new_session=True)
            if kills:
                time.sleep(KILLED_AFTER)
                os.killpg(process.pid, signal.SIGKILL)
                kills = False
            if process.wait():
                queue.put(command)

    threads = [threading.Thread(target=worker, args=(number,)) for number in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def runs(clip: RealClip, counts: list[int], openjd: str | None) -> Iterator[tuple[str, float, float, str]]:
    """Yield the name, wall seconds, processor seconds and digest of each way to render a clip."""

    def program(*words: object) -> None:
        command = [sys.executable, clip.program, *words]
        with (clip.folder / "log.txt").open("w") as log:
            subprocess.run([str(word) for word in command], check=True, stdout=log, stderr=log)

    for jobs in counts:
        clip.forget()
        out = clip.folder / f"frames-{jobs}"
        wall, cpu = timed(
            lambda jobs=jobs, out=out: program(  # type: ignore[misc]
                "render", clip.work, *LENS, "--jobs", jobs, "--out", out / "######.png"
            )
        )
        yield f"one command, --jobs {jobs}", wall, cpu, digest(out)
        shutil.rmtree(out)
    for workers, kill in [*((count, False) for count in counts), (max(counts), True)]:
        clip.forget()
        bundle = clip.folder / f"job-{workers}-{kill}"
        program("farm", clip.work, *LENS[:-1], "--chunk", CHUNK, "--out", bundle)
        job = json.loads((bundle / "template.json").read_text())
        commands = by_openjd(openjd, job, bundle) if openjd else tasks(job, bundle)["Render"]
        wall, cpu = timed(lambda: worked(commands, workers, kill))  # noqa: B023
        name = f"{len(commands)} tasks, {workers} workers" + (", one of them killed once" if kill else "")
        yield name, wall, cpu, digest(bundle / "output" / "frames")
        shutil.rmtree(bundle)


def main() -> None:
    """Print a table of the runs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--clip", default=CLIP, metavar="FILE[@WIDTH]", help="in the real data")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--workers", nargs="+", type=int, default=[1, 2, 4])
    options = parser.parse_args()
    openjd = shutil.which(os.environ.get("OPENJD", "openjd"))
    way = "openjd run" if openjd else "their commands"
    print(f"tasks by {way}, {os.cpu_count()} cores, {store.provenance()}")
    with tempfile.TemporaryDirectory(prefix="virtual-aperture-bench-") as folder:
        clip = opened(options.clip, Path(folder) / "clip", HEADLESS.absolute())
        if clip is None:
            sys.exit(f"not there: {options.clip}")
        longer = lengthened(clip, options.frames)
        longer.solve()
        first = ""
        print(
            "| run | wall, s | CPU s | wall s a frame | frames equal to the first run's |",
            "|---" * 5 + "|",
            sep="\n",
        )
        for name, wall, cpu, found in runs(longer, options.workers, openjd):
            first = first or found
            each = wall / options.frames
            print(
                f"| {name} | {wall:.1f} | {cpu:.1f} | {each:.2f} | {'yes' if found == first else 'no'} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
