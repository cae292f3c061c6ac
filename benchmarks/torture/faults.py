"""All faults, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from . import disks, kills, mutations, races
from .bench import Try

MANY = 1_000_000


@dataclass(frozen=True)
class Fault:
    """A kind of thing that goes wrong."""

    description: str
    """For the table."""
    run: Callable[[Try], None]
    most: int = MANY
    """Tries that make sense: those that take minutes are not repeated a hundred times."""


FAULTS = {
    "frames": Fault("ended while it renders a sequence (KILL, TERM, INT)", kills.frames),
    "movie": Fault("ended while it renders a movie", kills.movie),
    "overwriting": Fault("ended while it replaces frames of another lens", kills.overwriting),
    "jobs": Fault("one of several processes ended, or all of them", kills.jobs),
    "saving": Fault("ended while it saves and packs", kills.saving),
    "solving": Fault("ended while it solves, or solves again", kills.solving),
    "file-size": Fault("no file can grow beyond a size", disks.file_size),
    "small-disk": Fault("a disk of a few kilobytes is full", disks.small_disk),
    "no-space-to-save": Fault("no space to save and pack", disks.saving),
    "no-space-for-depth": Fault("no space, or too low a limit, for depth that is kept", disks.keeping_depth),
    "same-frames": Fault("two processes render one sequence", races.same_frames),
    "other-frames": Fault("two processes, one sequence, two lenses", races.other_frames),
    "other-movie": Fault("two processes, one movie, two lenses", races.other_movie),
    "two-solves": Fault("two solves go into one folder", races.solves),
    "another-container": Fault("a container looks into folders at work", races.another_container),
    "replaced": Fault("the clip is replaced while it is rendered", races.replaced_input),
    "removed": Fault("the masks are removed while frames are rendered", races.removed_input),
    "solve": Fault("a file of the working folder is damaged", mutations.solve),
    "footage": Fault("the clip is damaged", mutations.footage),
    "output": Fault("frames of an earlier run are damaged", mutations.output),
    "masks": Fault("a mask is damaged or repainted", mutations.masks),
    "depth": Fault("a depth map is damaged or repainted", mutations.depth),
    "kept-depth": Fault("depth that an earlier run kept is damaged", mutations.kept_depth),
    "not-finite": Fault("NaN and infinite pixels", mutations.not_finite),
    "long": Fault("2,000 frames, ended six times", kills.long, 3),
}
