"""The process that computes with a clip for a window: pictures of the preview, picks and strokes.

It is a Blender in the background with another GPU context. It reads a shot once and keeps it, so that depth,
subjects and highlights are remembered as long as they are worked with.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from weakref import ref

from ...core.base.parcel import pack, unpack
from ...core.base.worker import Call, Worker
from ...scene.base.events import watch
from ...scene.sources.shot import Filmed, Shot
from .launcher import CalledProcess, start

IDLE = 30.0
"""Seconds that a process waits for another call: the next picture comes at once meanwhile."""
LOOK = 1.0
"""Seconds between two looks whether it is idle."""
KEPT = 2
"""Shots that are remembered: an undo leads to the one before. Others are read again."""


class ClipProcess(CalledProcess):
    """A process that is ended when nothing was called for long."""

    stays: Callable[[], bool] = staticmethod(lambda: False)
    """Returns whether another call may come at any time."""

    def __init__(self, yields: bool = False) -> None:
        """Let a window and other processes go first if it `yields`."""
        super().__init__("preview's process")
        self._yields = yields
        self._used = 0.0
        """When it was called last; infinite before the first call."""
        # Blender knows timers by the object.
        self._timer = self._look

    def launch(self, worker: Worker) -> None:
        """Start the process."""
        start(worker, ["clip"], yields=self._yields, folder=worker.folder)
        worker.naming = SentShots(worker.folder)
        self._used = float("inf")
        watch(self._timer, LOOK, stays=True)

    def call[T](self, function: Callable[[], T]) -> Call[T]:
        """Have a function called there, and return at once; errors as of `begin`."""
        call = self.begin().call(function)
        self._used = time.monotonic()
        return call

    def _look(self) -> float | None:
        """A timer's turn: end a process that nothing was called of for long."""
        if self.worker is None:
            return None
        self.poll()
        if self.worker.calls or self.stays():
            self._used = time.monotonic()
        elif time.monotonic() - self._used > IDLE or not self.worker.is_running:
            self.end()
            return None
        return LOOK


CLIP = ClipProcess()
"""The one of this Blender: it takes all processors, so there are not two."""


class SentShots:
    """Names of shots, for `parcel.pack`."""

    def __init__(self, folder: Path) -> None:
        """Shots go into the folder as they are first named."""
        self._folder = folder
        self._sent: list[tuple[ref[Shot], ref[Filmed]]] = []
        """Each shot and its clip, which may have gone meanwhile."""

    def __call__(self, thing: object) -> object:
        if not isinstance(thing, Shot):
            return None
        for number, (shot, _) in enumerate(self._sent):
            if shot() is thing:
                return number
        number = len(self._sent)
        # Strokes leave the clip as it is.
        clip = next((n for n, (_, filmed) in enumerate(self._sent) if filmed() is thing.clip), number)
        self._sent.append((ref(thing), ref(thing.clip)))
        data = pack((clip, replace(thing, filmed=None, found=None)))
        _path(self._folder, number).write_bytes(data)
        return number


class ReceivedShots:
    """Shots by name, for `parcel.unpack`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._known: OrderedDict[int, tuple[int, Shot]] = OrderedDict()

    def __call__(self, number: int) -> Shot:
        if number not in self._known:
            clip, shot = unpack(_path(self._folder, number).read_bytes())
            alike = [other for other_clip, other in self._known.values() if other_clip == clip]
            self._known[number] = clip, alike[-1].with_subjects(shot.subjects) if alike else shot
        self._known.move_to_end(number)
        while len(self._known) > KEPT:
            self._known.popitem(last=False)
        return self._known[number][1]


def _path(folder: Path, number: int) -> Path:
    return folder / f"shot-{number}"
