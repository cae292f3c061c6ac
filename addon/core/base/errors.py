"""The one error type that crosses the wall towards the user."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import StrEnum


class Remedy(StrEnum):
    """A setting that helps the user to go on; each interface has a name for it."""

    FRAMES = "frames"
    """Which frames of the clip are solved."""
    STEP = "step"
    """Which frames of the clip are solved, where they are every second one or fewer."""
    WORK_DIR = "work_dir"
    """The working folder."""
    SOLVE = "solve"
    """Solving the clip."""
    AGAIN = "again"
    """Solving, or importing, in place of the working folder's solve."""
    FOCAL = "focal"
    """The focal length."""
    OVERWRITE = "overwrite"
    """Writing over output that exists."""
    DEPTH_MAPS = "depth_maps"
    """Depth maps of the clip, from elsewhere."""
    STILLS = "stills"
    """Solving pictures as photos in no order."""
    KEPT_DEPTH = "kept_depth"
    """How much depth of a clip is kept."""


Words = Mapping[Remedy, str]
"""An interface's names for the remedies; it may lack those that it does not have."""


class UserError(Exception):
    """A problem that the user can solve, in one line: the problem, its place, and the way out.

    The command line prints the message and ends with a non-zero status; operators report it. The message
    names no interface's controls: `remedies` list the settings that help. Any other error is a bug and keeps
    its traceback.
    """

    def __init__(self, message: str, *remedies: Remedy) -> None:
        super().__init__(message)
        self.remedies = remedies

    def worded(self, words: Words) -> str:
        """The message with an interface's names for the remedies."""
        return with_words(str(self), self.remedies, words)


def with_words(text: str, remedies: Iterable[Remedy], words: Words) -> str:
    """Return a text with an interface's names of the remedies in brackets."""
    names = [words[remedy] for remedy in remedies if remedy in words]
    return f"{text} ({', '.join(names)})" if names else text
