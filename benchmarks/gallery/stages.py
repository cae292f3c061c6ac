"""The steps of a clip, each kept by a digest of code, clip and options: a stopped run resumes."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from .. import store
from . import commands
from .clips import RealClip
from .commands import Ended

BUILD = store.ROOT / "build" / "real"
NOTHING_PICKED = Path(__file__).with_name("nothing_picked.py")
BLUR = 0.03
"""Share of the picture's width; the window's default, too."""
SOLVER = ("base", "camera", "optics", "media", "readers", "depth", "subjects", "sfm")
"""Rooms of `core` that a solve may be made by."""
INTERRUPTED = 128
"""Exit statuses from here on, and negative ones, are of commands that were ended by a signal."""


@dataclass(frozen=True)
class Program:
    """A checkout's `addon/headless.py`."""

    headless: Path
    segmenter: Path | None = None
    """The user's own, for all pictures."""

    @cached_property
    def solver(self) -> str:
        """Digest of the code of a solve."""
        core = self.headless.parent / "core"
        return store.digest([path for room in SOLVER for path in _code(core / room)])

    @cached_property
    def code(self) -> str:
        """Digest of the whole add-on."""
        return store.digest(_code(self.headless.parent))

    @cached_property
    def commit(self) -> str:
        """The checkout's commit, and whether its add-on was changed since."""
        git = ["git", "-C", str(self.headless.parents[1])]
        commit, changed = (
            subprocess.run([*git, *words], capture_output=True, text=True, check=False).stdout.strip()
            for words in (["rev-parse", "--short", "HEAD"], ["status", "--short", "--", "addon"])
        )
        return f"{commit or 'unknown'}{' with changes' if changed else ''}"


@dataclass(frozen=True)
class Steps:
    """A clip's steps with one program. Each is run once, and its end is kept; failures are kept, too."""

    clip: RealClip
    program: Program

    @property
    def solves(self) -> Path:
        """Folder of the solve, which other code of rendering shares."""
        return BUILD / f"solve-{self.program.solver}" / self.clip.name

    @property
    def folder(self) -> Path:
        """Folder of the pictures."""
        by = f"-{self.program.segmenter.stem}" if self.program.segmenter else ""
        return BUILD / f"code-{self.program.code}{by}" / self.clip.name

    @property
    def click(self) -> str:
        """The click as `--focus-at` has it."""
        x, y = self.clip.click
        return f"{x},{y}@{self.clip.middle}"

    def solve(self, run: bool = True) -> Ended | None:
        """Solve the clip."""
        words = ("solve", self.clip.file, "--work", self.solves / "work")

        def work() -> Ended:
            return self._command(self.solves / "solve.log", words)

        return self._kept(self.solves, "solve", words, run, work)

    def clicked(self, run: bool = True) -> Ended | None:
        """Render the middle frame and those after it with a click on the subject, nothing being kept."""
        frames = self.clip.near_middle
        words = (*self._lens(), "--frames", f"{frames[0]}-{frames[-1]}", *self._output("click"))

        def work() -> Ended:
            shutil.rmtree(self.folder, ignore_errors=True)
            # Depth that other code kept has no part in it.
            shutil.copytree(self.solves / "work", self.folder / "work", ignore=lambda *_: ["depth"])
            return self._command(self.folder / "click.log", words, self.picture("click", frames[0]))

        return self._kept(self.folder, "click", words, run, work)

    def default(self, run: bool = True) -> Ended | None:
        """Render the middle frame as the window has it with nothing picked."""
        blend, frame = self.folder / "default.blend", self.clip.middle
        words = ("render", blend, "--frames", f"{frame}-{frame}", *self._output("default"))

        def work() -> Ended:
            saved = commands.run(
                (
                    "-P",
                    NOTHING_PICKED,
                    self.program.headless,
                    self.clip.file,
                    self.folder / "work",
                    blend,
                    self.program.segmenter or "",
                ),
                self.folder / "nothing_picked.log",
            )
            return saved if saved.status else self._command(self.folder / "default.log", words)

        return self._kept(self.folder, "default", words, run, work)

    def row(self, run: bool = True) -> Ended | None:
        """Render frames spread over the clip with the same click."""
        frames = self.clip.row
        spread = f"{frames[0]}-{frames[-1]}:{frames.step}"
        words = (*self._lens(), "--frames", spread, *self._output("row"))
        return self._kept(
            self.folder, "row", words, run, lambda: self._command(self.folder / "row.log", words)
        )

    def picture(self, kind: str, frame: int) -> Path:
        """A rendered frame of "click", "default" or "row"."""
        return self.folder / kind / f"{frame:04d}.png"

    def _lens(self) -> tuple[object, ...]:
        by = ("--segmenter", self.program.segmenter) if self.program.segmenter else ()
        return "render", self.folder / "work", *by, "--focus-at", self.click, "--blur", BLUR

    def _output(self, kind: str) -> tuple[object, ...]:
        return "--jobs", 1, "--out", self.folder / kind / "####.png"

    def _command(self, log: Path, words: Sequence[object], first: Path | None = None) -> Ended:
        return commands.run((self.program.headless, *words), log, first)

    def _kept(
        self, folder: Path, name: str, words: Sequence[object], run: bool, work: Callable[[], Ended]
    ) -> Ended | None:
        """How a step ended, as it is kept; else it is done, or is None where it is not to be `run`."""
        file = folder / f"{name}.json"
        relative = [str(word).replace(str(BUILD), "") for word in words]
        key = store.digest(relative, self._clip_digest, self.program.solver)
        if file.exists():
            held = json.loads(file.read_text())
            if held.pop("key") == key:
                return Ended(**held)
        if not run:
            return None
        shutil.rmtree(folder / name, ignore_errors=True)
        ended = work()
        if 0 <= ended.status < INTERRUPTED:
            folder.mkdir(parents=True, exist_ok=True)
            part = file.with_suffix(".part")
            part.write_text(json.dumps(ended.as_dict() | {"key": key}, indent=1))
            part.rename(file)
        return ended

    @cached_property
    def _clip_digest(self) -> str:
        file = self.clip.file
        return store.digest(sorted(file.iterdir()) if file.is_dir() else [file])


def _code(folder: Path) -> list[Path]:
    """Files of a folder that a program consists of, sorted."""
    return sorted(path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
