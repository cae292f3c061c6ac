"""What `make bench` runs: scenes, tracks, methods, views and blurs, and which of it is stale."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from sample_scenes import filming

from .judge import Judge
from .methods import METHODS
from .rows import Book, Key, Row
from .scenes import BLURS, SIZE, Short

TRACKS = {
    "T1": "T1: true depth and cameras", "T2": "T2: from the video alone",
    "T3": "T3: from the video, true mattes", "T4": "T4: from the video, one stroke on each subject",
}  # fmt: skip
MAIN_BLUR = round(0.05 * SIZE[0])
"""Pixels of the largest disc that every scene is judged at."""
ALL_BLURS = tuple(round(share * SIZE[0]) for share in BLURS)
BLURRED = "fence"
"""The scene that is judged at every blur: many depth jumps, and no clipped lamps, so its truth is cheap."""
FEW = ("no blur", "thesis", "layers", "normal", "Defocus")
"""Methods of the other blurs, and of scenes with subjects."""
MAKING_S, ROW_S = 160.0, 4.0
"""Processor seconds of a scene's clip, solve and truth, and of a row, where no run has measured
them: those of walk and stroller."""


class Wanted(NamedTuple):
    """One row of the plan."""

    blur: int
    track: str
    method: str
    views: int


@dataclass(frozen=True)
class Part:
    """Which part of the plan is asked for; empty sequences stand for all."""

    scenes: Sequence[str] = ()
    tracks: Sequence[str] = ()
    blurs: Sequence[int] = ()
    methods: Sequence[str] = ()


def tracks_of(scene: str) -> tuple[str, ...]:
    """Those that a scene is judged on: with mattes where it has subjects."""
    return tuple(TRACKS) if scene in filming.SUBJECTS else ("T1", "T2")


def wanted(scene: str, part: Part) -> Iterator[Wanted]:
    """The rows of a scene, the main blur first; what is asked for by name is not left to `FEW`."""
    default = ALL_BLURS if scene == BLURRED else (MAIN_BLUR,)
    for blur in sorted(part.blurs or default, key=lambda blur: blur != MAIN_BLUR):
        few = scene in filming.SUBJECTS or blur != MAIN_BLUR
        for track in tracks_of(scene):
            if track not in (part.tracks or TRACKS):
                continue
            for name, method in METHODS.items():
                if track not in method.tracks or name not in (part.methods or (FEW if few else METHODS)):
                    continue
                yield from (Wanted(blur, track, name, views) for views in method.views)


def possible(key: Key) -> bool:
    """Whether the plan, or a part that can be asked for, has such a row."""
    scene, track, name, views, blur = key
    known = scene in filming.STAGES and track in tracks_of(scene) and blur in ALL_BLURS
    return known and name in METHODS and views in METHODS[name].views


def why_stale(row: Row | None, inputs: str) -> str:
    """The reason why a row is to be measured again; empty where it is up to date."""
    if row is None:
        return "never measured"
    if row.inputs == inputs:
        return ""
    (scene, _, code), (wanted_scene, _, wanted_code) = row.inputs.partition("-"), inputs.partition("-")
    changes = [
        name for name, differs in (("scene", scene != wanted_scene), ("code", code != wanted_code)) if differs
    ]
    return " and ".join(changes) + " changed"


@dataclass(frozen=True)
class Stale:
    """What is to be done for a scene."""

    scene: str
    reasons: dict[Wanted, str]
    seconds: float
    """Processor seconds that it will take, about."""

    def __str__(self) -> str:
        if not self.reasons:
            return f"{self.scene:10} up to date"
        told = "; ".join(f"{count} {reason}" for reason, count in Counter(self.reasons.values()).items())
        return f"{self.scene:10} {len(self.reasons):3} rows stale ({told}), about {self.seconds:.0f} CPU s"


def stale(name: str, part: Part, book: Book) -> Stale:
    """The rows of a scene that are to be measured, and what that costs by the last run."""
    scene = Short(name)
    judges = {blur: Judge(scene, blur) for blur in ALL_BLURS}
    reasons, seconds = {}, 0.0
    for each in wanted(name, part):
        row = book.rows.get((name, each.track, each.method, each.views, each.blur))
        if reason := why_stale(row, judges[each.blur].inputs(each.track, each.method)):
            reasons[each] = reason
            seconds += ROW_S if row is None else row.spent_s
    if reasons and not scene.is_filmed:
        # Half of it is the truth, one for each blur.
        blurs = len({each.blur for each in reasons})
        seconds += book.making_s.get(name, MAKING_S * (1 + blurs) / 2)
    return Stale(name, reasons, seconds)


def report(stales: Collection[Stale], side_by_side: int) -> str:
    """What is stale and why, a line for each scene, and the time that it will take."""
    seconds = sum(each.seconds for each in stales)
    return "\n".join([
        *map(str, stales),
        f"about {seconds / 60:.0f} CPU minutes, {seconds / 60 / side_by_side:.0f} minutes"
        f" on {side_by_side} idle cores",
    ])  # fmt: skip
