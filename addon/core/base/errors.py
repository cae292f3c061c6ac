"""The error type for problems that the user can solve."""

from collections.abc import Iterable, Mapping
from enum import StrEnum


class Remedy(StrEnum):
    """A setting that solves a problem; each interface has its own name for it."""

    FRAMES = "frames"
    STEP = "step"
    """The step between solved frames."""
    WORK_DIR = "work_dir"
    SOLVE = "solve"
    AGAIN = "again"
    """Solving or importing again, in place of the working folder's contents."""
    FOCAL = "focal"
    """The known focal length."""
    OVERWRITE = "overwrite"
    DEPTH_MAPS = "depth_maps"
    STILLS = "stills"
    """Solving pictures as unordered photos."""
    PIXEL_ASPECT = "pixel_aspect"
    """The width of a stored pixel by its height."""
    KEPT_DEPTH = "kept_depth"
    """The amount of depth kept for a clip."""


Words = Mapping[Remedy, str]
"""An interface's names for the remedies; it may lack some."""


class UserError(Exception):
    """A problem that the user can solve, in one line: the problem, its place and the solution.

    The command line prints the message and exits with a non-zero status; operators report it. The message
    names no controls of an interface: `remedies` lists those that help. Any other exception is a bug.
    """

    def __init__(self, message: str, *remedies: Remedy) -> None:
        super().__init__(message)
        self.remedies = remedies

    def worded(self, words: Words) -> str:
        """Return the message with an interface's names for the remedies."""
        return with_words(str(self), self.remedies, words)


def with_words(text: str, remedies: Iterable[Remedy], words: Words) -> str:
    """Append an interface's names for the remedies to a text, in brackets."""
    names = [words[remedy] for remedy in remedies if remedy in words]
    return f"{text} ({', '.join(names)})" if names else text
