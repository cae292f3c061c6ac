"""What every try needs: an untouched reference, a folder of its own, the program, and a verdict."""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from types import MappingProxyType

from . import clip

ROOT = Path(__file__).resolve().parents[2]
HEADLESS = ROOT / "addon" / "headless.py"
FRAMES = 24
LENS = ("--focus-distance", "7", "--blur", "0.05", "--method", "features", "--views", "4")
DENSE = (*LENS[:4], "--views", "4")
"""The same by the method that reads masks and depth maps."""
OTHER = ("--focus-distance", "9", "--blur", "0.08", "--method", "features", "--views", "4")
"""Another lens, whose pictures are others."""
HANGS = 90.0
"""Seconds of a busy machine after which a run hangs: an untouched one takes two."""
KEPT_DEPTH = "depth"
"""Folder of a solve that keeps what was found of its frames' depth (`addon/scene/sources/shot.py`)."""
FOREIGN = ("blender_", "mesa_shader_cache", "matplotlib")
"""How names of what Blender and its libraries leave in the folder for temporary files begin."""

Files = dict[str, bytes]


@dataclass
class Verdict:
    """What a try came to; all False is as it should be."""

    lost: bool = False
    """Something of the user's, or a finished frame, was changed or is gone."""
    crash: bool = False
    """A process ended by a signal that nobody sent, or by an error that is not one readable line."""
    hang: bool = False
    leftover: bool = False
    """Files or processes that are still there after the next run."""
    wrong: bool = False
    """Status 0, and the output is not what an untouched run gives."""
    note: str = ""
    """For whoever looks into it."""

    def add(self, kind: str, note: str) -> None:
        """One more thing that is wrong, of a kind named as the fields are."""
        setattr(self, kind, True)
        self.note = f"{self.note}; {kind}: {note}".removeprefix("; ")

    def as_dict(self) -> dict[str, object]:
        return asdict(self)


@dataclass
class Run:
    """A process of the command line that has ended."""

    status: int
    """Negative: the signal that ended it."""
    said: str
    hung: bool = False
    seconds: float = 0.0


@dataclass
class Try:
    """One try: its own folder, its own dice."""

    bench: Bench
    folder: Path
    dice: random.Random
    verdict: Verdict = field(default_factory=Verdict)
    patience: float = HANGS
    """Seconds after which a run hangs."""

    @property
    def temporary(self) -> Path:
        """The folder for temporary files of all processes of this try."""
        path = self.folder / "tmp"
        path.mkdir(exist_ok=True)
        return path

    def start(
        self,
        *arguments: object,
        limits: Callable[[], None] | None = None,
        before: Sequence[str] = (),
        environment: Mapping[str, str] = MappingProxyType({}),
    ) -> subprocess.Popen[str]:
        """Start the command line, the leader of a group of its own; `before` are words before its own."""
        return subprocess.Popen(
            [*before, sys.executable, str(HEADLESS), *map(str, arguments)],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", cwd=self.folder,
            start_new_session=True, preexec_fn=limits,
            env=os.environ | {"TMPDIR": str(self.temporary), "PYTHONUNBUFFERED": "1",
                              "XDG_CACHE_HOME": str(self.folder / "cache")} | dict(environment),
        )  # fmt: skip

    def end(self, process: subprocess.Popen[str], expected: Iterable[int] = ()) -> Run:
        """Wait for a process and judge how it ended; `expected` are signals that were sent to it."""
        hung, began = False, time.monotonic()
        try:
            said, _ = process.communicate(timeout=self.patience)
        except subprocess.TimeoutExpired:
            hung = True
            os.killpg(process.pid, signal.SIGKILL)
            said, _ = process.communicate()
            self.verdict.add("hang", said[-300:])
        run = Run(process.returncode, said, hung, time.monotonic() - began)
        if not hung and run.status < 0 and -run.status not in expected:
            self.verdict.add("crash", f"{signal.Signals(-run.status).name} {said[-300:]}")
        elif "Traceback" in said or "--debug shows where" in said:
            at = max(said.find("Traceback"), said.find("--debug shows"), 0)
            self.verdict.add("crash", said[max(0, at - 200) : at + 1200])
        return run

    def run(self, *arguments: object, limits: Callable[[], None] | None = None) -> Run:
        """Run the command line to its end."""
        return self.end(self.start(*arguments, limits=limits))

    def expect(self, files: Files, out: Path, run: Run, folder: Path | None = None) -> None:
        """After a run that nothing disturbed: it was a success, and exactly these files are there."""
        if run.hung:
            return
        if run.status:
            self.verdict.add("lost", f"the next run ended with {run.status}: {run.said[-400:]}")
            return
        there = contents(folder or out.parent)
        if bad := sorted(name for name in files if there.get(name) != files[name]):
            self.verdict.add("wrong", f"{bad[:3]} of {len(bad)} differ from the reference")
        self.look_for_leftovers(set(files), set(there))

    def look_for_leftovers(self, expected: set[str], there: set[str]) -> None:
        """Files in the output beside those expected, and anything of ours for temporary files."""
        litter = sorted(there - expected)
        litter += [p.name for p in self.temporary.iterdir() if not p.name.startswith(FOREIGN)]
        if litter:
            self.verdict.add("leftover", ", ".join(litter[:5]))

    def check_partial(self, files: Files, folder: Path) -> None:
        """What lies in the output under a final name is whole and right, whenever that is looked at."""
        for name, data in contents(folder).items():
            if name in files and files[name] != data:
                self.verdict.add("wrong", f"{name} is there and not right")
                return


def contents(folder: Path) -> Files:
    """Every file below a folder, by its relative path."""
    if not folder.is_dir():
        return {}
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def file_limit(size: int) -> Callable[[], None]:
    """A full disk: files cannot grow beyond so many bytes."""

    def limit() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return limit


class Bench:
    """The tiny clip, its solve, and what untouched runs give."""

    def __init__(self, folder: Path) -> None:
        """`folder` is made anew unless it is whole."""
        self.folder = folder
        self.clip, self.work = folder / "clip" / "clip.mp4", folder / "work"
        self.masks, self.depth, self.floats = (folder / name for name in ("masks", "depth", "floats"))
        self.floats_rendered = folder / "floats_rendered"
        self.walk, self.walk_work = folder / "walk", folder / "walk_work"
        self._counted = 0
        done = folder / "done"
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            clip.write_video(self.clip.parent, FRAMES)
            clip.solve(self.clip, self.work)
            clip.write_masks(self.masks, FRAMES)
            clip.write_depth(self.depth, FRAMES)
            clip.write_floats(self.floats, 6)
            clip.write_walk(self.walk)
            self._make_references()
            done.touch()
        self.frames, self.others = contents(folder / "frames"), contents(folder / "others")
        self.masked = contents(folder / "masked")
        self.movie, self.other_movie = ((folder / f"{name}.mp4").read_bytes() for name in ("one", "other"))
        self.seconds = float((folder / "seconds").read_text())
        self.solve_seconds = float((folder / "solve_seconds").read_text())

    def _make_references(self) -> None:
        one = Try(self, self.folder, random.Random(0))
        began = time.monotonic()
        runs = [one.run("render", self.work, *LENS, "--out", self.folder / "frames" / "####.png")]
        (self.folder / "seconds").write_text(str(time.monotonic() - began))
        runs.append(one.run("render", self.work, *OTHER, "--out", self.folder / "others" / "####.png"))
        runs.append(one.run("render", self.work, *LENS, "--out", self.folder / "one.mp4"))
        runs.append(one.run("render", self.work, *OTHER, "--out", self.folder / "other.mp4"))
        masked = self.folder / "masked" / "####.png"
        runs.append(one.run("render", self.work, *DENSE, "--mask", self.masks, "--out", masked))
        work = clip.solve(self.floats, self.folder / "floats_work")
        runs.append(one.run("render", work, *LENS, "--out", self.floats_rendered / "####.png"))
        began = time.monotonic()
        runs.append(one.run("solve", self.walk, "--work", self.walk_work))
        (self.folder / "solve_seconds").write_text(str(time.monotonic() - began))
        for run in runs:
            if run.status:
                raise RuntimeError(f"an untouched run failed: {run.said}")

    def attempt(self, fault: Callable[[Try], None], seed: str) -> Verdict:
        """One try of a fault in a folder of its own, which is removed unless something is wrong."""
        self._counted += 1
        folder = self.folder / "tries" / f"{os.getpid()}-{self._counted}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        one = Try(self, folder, random.Random(seed))
        inputs = self._inputs()
        try:
            fault(one)
        finally:
            if self._inputs() != inputs:
                one.verdict.add("lost", "the clip or its solve was changed")
            shutil.rmtree(folder, ignore_errors=True)
        return one.verdict

    def _inputs(self) -> Files:
        """What no try may change: the clip and its solve, but for the depth that is kept beside it."""
        work = {name: data for name, data in contents(self.work).items() if Path(name).parts[0] != KEPT_DEPTH}
        return contents(self.clip.parent) | {f"work/{name}": data for name, data in work.items()}

    def project(self, folder: Path) -> Path:
        """A copy of the clip and its solve that a try may spoil; the working folder."""
        shutil.copytree(self.clip.parent, folder / "clip")
        return clip.solve(folder / "clip" / "clip.mp4", folder / "work")
