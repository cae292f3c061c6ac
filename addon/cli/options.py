"""The parser of the command line, the types of its options, and its words for remedies."""

import argparse
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from ..core.base import numbers
from ..core.base.errors import Remedy, UserError, Words
from ..core.base.file_names import checked_name
from ..core.base.limits import KEPT_DEPTH
from ..core.base.options import Option

SWITCH = {"on": True, "off": False}
"""The words of an option that is on or off."""

type Commands = argparse._SubParsersAction[argparse.ArgumentParser]
"""Type of the result of `add_subparsers`."""
SMALLEST = 1e-15
"""No number but 0 is smaller: Blender keeps 32-bit floats, and smaller ones become 0 there."""
WORDS: Words = {
    Remedy.FRAMES: "--frames A-B",
    Remedy.STEP: "--frames A-B:STEP",
    Remedy.WORK_DIR: "--work DIR",
    Remedy.SOLVE: "headless.py solve FOOTAGE --work DIR",
    Remedy.AGAIN: "--again",
    Remedy.FOCAL: "--focal, --focal35, --focal-mm or --fov",
    Remedy.DEPTH_MAPS: "--depth-maps PATH",
    Remedy.OVERWRITE: "--overwrite",
    Remedy.STILLS: "--stills",
    Remedy.PIXEL_ASPECT: "--pixel-aspect X",
    Remedy.KEPT_DEPTH: KEPT_DEPTH,
}
SOLVED_WORDS: Words = {
    **WORDS,
    Remedy.FRAMES: "--solve-frames A-B",
    Remedy.STEP: "--solve-frames A-B:STEP",
    Remedy.DEPTH_MAPS: "--depth PATH",
}
"""Words of commands whose `--frames` are the rendered ones, and whose depth maps are the lens's."""
IMPORT_WORDS: Words = {**WORDS, Remedy.DEPTH_MAPS: "render DIR --depth PATH"}
"""Words of `import`, whose depth maps are those of a later render."""


class UsageError(UserError):
    """Invalid arguments: status 2, which farms distinguish from a failed task."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are `UsageError`s, one line as all others of a command are.

    Options are written in full: an abbreviation would mean another one once there is an option more.
    """

    def __init__(self, **named: Any) -> None:
        super().__init__(**{**named, "allow_abbrev": False})

    def error(self, message: str) -> NoReturn:
        """Raise UsageError with a hint at the help, where argparse would end the process.

        Args:
            message: The reason that argparse gives, such as a missing argument.
        """
        raise UsageError(f"{message}; see {self.prog} --help")


def real(text: str) -> float:
    """Read the value of an option that is a number.

    Raises:
        argparse.ArgumentTypeError: It is not a number, or too large or too small for Blender.
    """
    try:
        value = numbers.real(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    if value and not SMALLEST <= abs(value) <= numbers.LARGEST:
        raise argparse.ArgumentTypeError(
            f"{text!r} is too {'large' if abs(value) > 1 else 'small'}; numbers go from {SMALLEST:g} to"
            f" {numbers.LARGEST:g}"
        )
    return value


def whole(least: int, most: int = numbers.LARGEST_WHOLE) -> Callable[[str], int]:
    """Return the type of an option that is a whole number from `least` to `most`."""

    def parse(text: str) -> int:
        try:
            value = numbers.whole(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text[:40]} is not from {least} to {most}")
        return value

    return parse


def _words(option: Option) -> Mapping[str, Any]:
    return SWITCH if option.kind is bool else option.words or {}


def value_type(option: Option) -> Callable[[str], Any]:
    """Return the command line's type of a declared option: angles in degrees, and words for some values."""

    def parse(text: str) -> Any:
        words = _words(option)
        if text in words:
            return words[text]
        try:
            value = _value(option, text)
            option.check(value)
        except UserError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        except (ValueError, argparse.ArgumentTypeError) as error:
            either = f"; it can also be {' or '.join(words)}" if words else ""
            raise argparse.ArgumentTypeError(f"{error}{either}") from None
        return value

    return parse


def _value(option: Option, text: str) -> Any:
    if option.kind is bool:
        raise ValueError(f"{text!r} is neither")
    if option.kind is str:
        return text
    if option.kind is int:
        return numbers.whole(text)
    return math.radians(real(text)) if option.unit == "ANGLE" else real(text)


def text_of(option: Option, value: Any) -> str:
    """Return a value as the command line writes it: the inverse of `value_type`."""
    for word, meant in _words(option).items():
        if meant == value and value not in (option.choices or ()):
            return word
    return repr(math.degrees(value)) if option.unit == "ANGLE" else str(value)


def add_options(command: argparse.ArgumentParser, options: Mapping[str, Option]) -> None:
    """Add an option of the command line for each declared one, by its name; None where it is not given."""
    for name, each in options.items():
        choices = each.choices or {}
        meanings = (f"{key}: {choice.help}" for key, choice in choices.items())
        help_text = "; ".join([each.help, *meanings, f"default: {text_of(each, each.initial)}"])
        value = [] if each.kind is bool else [each.metavar or ("N" if each.kind is int else "X")]
        command.add_argument(
            f"--{name.replace('_', '-')}", dest=name, type=value_type(each), choices=list(choices) or None,
            metavar=None if choices else "|".join([*value, *_words(each)]), help=help_text.replace("%", "%%"),
        )  # fmt: skip


def path(text: str) -> Path:
    """Return a path as it was typed; UserError for one that is empty or not UTF-8.

    Two slashes in front are one, as everywhere but in Blender, to which they mean the folder of the .blend.
    """
    if not text:
        # Python takes it for the current folder.
        raise UserError("a file or folder name is empty")
    if os.name == "posix" and text.startswith("//"):
        text = "/" + text.lstrip("/")
    checked_name(Path(text).absolute())
    return Path(text)
