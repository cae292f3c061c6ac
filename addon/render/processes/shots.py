"""Shots in another process: each is sent once, and the knowledge about its clip stays there."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from pathlib import Path
from weakref import ref

from ...core.base.atomic import hand_over
from ...core.base.parcel import pack, unpack
from ...scene.sources.shot import Filmed, Shot

KEPT = 2
"""Shots that are remembered: an undo leads to the one before. Others are read again."""


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
        hand_over(_path(self._folder, number), pack((clip, replace(thing, filmed=None, found=None))))
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
