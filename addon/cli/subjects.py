"""Subjects on the command line: strokes that mark them, and focus on one."""

import argparse
from collections.abc import Sequence

from ..core.base import numbers
from ..core.base.errors import UserError
from ..core.subjects.strokes import MarkedSubject, Stroke, places_of
from ..scene.sources.subjects import DEFAULT_NAME
from .options import UsageError

NEAREST = "nearest"
"""Name of the nearest person in every frame, which needs no stroke."""
EXAMPLE = "0.44,0.26 0.45,0.5 0.44,0.8@30"


def add_subjects(command: argparse.ArgumentParser) -> None:
    """Add the option that marks subjects."""
    command.add_argument(
        "--subject", metavar="[NAME=]X,Y", nargs="+", action="append",
        help=f"a stroke over a moving subject, such as {EXAMPLE}: places in the picture, with a frame after"
        f" the last one; repeat for more strokes, with NAME= before the first place for more subjects",
    )  # fmt: skip


def add_focus_subject(command: argparse.ArgumentParser) -> None:
    """Add the option that puts a subject in focus."""
    command.add_argument(
        "--focus-subject", metavar="[NAME][@FRAME]", nargs="?", const="", action="append",
        help="keep a marked subject in focus, or `nearest`, the nearest person of every frame; with a frame,"
        " also together with --focus-at, it is one end of a focus pull",
    )  # fmt: skip


def subjects_of(options: argparse.Namespace, frame: int) -> tuple[MarkedSubject, ...]:
    """Return the subjects that strokes mark; one that names no frame is in `frame`.

    UserError for a stroke that is not understood.
    """
    strokes = dict[str, list[Stroke]]()
    for words in options.subject or ():
        name, stroke = _stroke(words, frame)
        strokes.setdefault(name, []).append(stroke)
    return tuple(MarkedSubject(name, tuple(each)) for name, each in strokes.items())


def focused_subjects(options: argparse.Namespace) -> list[tuple[str, int | None]]:
    """Return the names of the subjects in focus, and their frames, where given.

    Raises:
        UserError: A name is not valid, or no stroke marks the subject.
    """
    marked = [subject.name for subject in subjects_of(options, 0)]
    found = []
    for text in options.focus_subject or ():
        name, at, frame = text.rpartition("@") if "@" in text else (text, "", "")
        try:
            number = numbers.whole(frame) if at else None
        except ValueError:
            raise UserError(f"the subject {text!r} is not valid; write NAME, NAME@FRAME or @FRAME") from None
        name = name or (marked[0] if marked else DEFAULT_NAME)
        if name not in marked and name != NEAREST:
            raise UsageError(
                f"there is no stroke on a subject {name!r} to focus on; mark it with --subject, such as"
                f" --subject {'' if name == DEFAULT_NAME else f'{name}='}{EXAMPLE}"
            )
        found.append((name, number))
    return found


def _stroke(words: Sequence[str], frame: int) -> tuple[str, Stroke]:
    """The name of a subject, and a stroke, from places such as "NAME=X,Y", "X,Y" and "X,Y@FRAME"."""
    text = " ".join(words)
    name, named, rest = text.partition("=")
    line, at, number = (rest if named else text).partition("@")
    try:
        places = places_of(line.split())
        found = numbers.whole(number) if at else frame
    except ValueError:
        raise UserError(f"the stroke {text!r} is not valid; write places such as {EXAMPLE}") from None
    if not places:
        raise UserError(f"the stroke {text!r} has no places; write places such as {EXAMPLE}")
    return (name.strip() if named else DEFAULT_NAME) or DEFAULT_NAME, Stroke(found, places)
