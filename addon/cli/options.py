"""The parser of the command line, and the types of its options: what is refused is refused in one line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import NoReturn

from ..core.base import numbers
from ..core.base.errors import UserError

SMALLEST = 1e-15
"""No number but 0 is smaller: Blender keeps 32-bit floats, and smaller ones become 0 there."""


class UsageError(UserError):
    """Arguments that are not understood: status 2, which farms tell from a task that failed."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are `UsageError`s, one line as all others of a command are."""

    def error(self, message: str) -> NoReturn:
        """UsageError that says where help is."""
        raise UsageError(f"{message}; {self.prog} --help tells what it takes")


def real(text: str) -> float:
    """The type of an option that is a number."""
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
    """The type of an option that is a whole number from `least` to `most`."""

    def parse(text: str) -> int:
        try:
            value = numbers.whole(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text[:40]} is not from {least} to {most}")
        return value

    return parse
