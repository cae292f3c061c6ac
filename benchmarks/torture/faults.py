"""All faults, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from . import containers, disks, kills, mutations, options, pans, races, scenes, sizes, strangers, users_files
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
    "switching": Fault("ended, and then rendered with another lens", kills.switching),
    "jobs": Fault("one of several processes ended, or all of them", kills.jobs),
    "saving": Fault("ended while it saves and packs", kills.saving),
    "solving": Fault("ended while it solves, or solves again", kills.solving),
    "file-size": Fault("no file can grow beyond a size", disks.file_size),
    "small-disk": Fault("a disk of a few kilobytes is full", disks.small_disk),
    "no-space-to-save": Fault("no space to save and pack", disks.saving),
    "no-space-for-depth": Fault("no space, or too low a limit, for depth that is kept", disks.keeping_depth),
    "same-frames": Fault("two processes render one sequence", races.same_frames),
    "other-frames": Fault("two processes, one sequence, two lenses", races.other_frames),
    "same-movie": Fault("two processes render one movie", races.same_movie),
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
    "report": Fault("the file of reports is damaged", mutations.report),
    "blend": Fault("a property of a .blend is damaged", mutations.blend),
    "scene-settings": Fault("a scene setting that frames do not depend on", scenes.settings),
    "other-maps": Fault("depth maps of another rate, shape or format", scenes.maps),
    "movie-folder": Fault("files of the user's in a movie's folder of frames", users_files.movie_folder),
    "names": Fault("names as cameras and versions give them, beside hidden files", users_files.names),
    "own-report": Fault("a file of reports in the place of a solve's state", users_files.own_report),
    "edited-frame": Fault("a frame is edited after the render", users_files.edited_frame),
    "options": Fault("an option that means nothing", options.numbers),
    "models": Fault("no solve, or one of every second frame, is imported", options.models),
    "places": Fault("no file, or no folder, where output is to go", options.places),
    "not-finite": Fault("NaN and infinite pixels", mutations.not_finite),
    "middle": Fault("a byte of a clip of 80 MiB is changed, its time put back", strangers.middle),
    "not-files": Fault("a pipe or a device in place of a file", strangers.not_files),
    "lies": Fault("counts and sizes that no file bears out", strangers.lies),
    "odd-clips": Fault("whole clips as other programs make them, sound longer or late", containers.odd),
    "shown-clips": Fault("clips turned, mirrored, cropped, of two tracks, sound unknown", containers.shown),
    "broken-clips": Fault("a packet of a clip is damaged, or its end is missing", containers.broken),
    "lists": Fault("a list of files by the name of a video", containers.lists),
    "pans": Fault("a pan through a lens that bends, zooms or is read row by row", pans.pan, 10),
    "wide": Fault("pictures of 16,384 x 96", sizes.wide, 10),
    "large": Fault("pictures of 16,384 x 9,216", sizes.large, 6),
    "long": Fault("2,000 frames, ended six times", sizes.long, 3),
}
