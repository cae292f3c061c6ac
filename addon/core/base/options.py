"""Options of the user's, declared once: a field of a dataclass says all that interfaces must know of it.

The Blender property, the option of the command line, a preset's key and the check of bounds are made from
that field, so that a new option is one entry (and a row in a panel, if it is to have one):

>>> @dataclass(frozen=True)
... class Sharpening:
...     amount: float = option(0.5, "Sharpening", "How much edges are raised", least=0.0, most=2.0)
>>> check(Sharpening(3.0))
Traceback (most recent call last):
UserError: sharpening cannot be 3; give a number from 0 to 2
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from .errors import UserError

KEY = "option"
"""Key of a field's metadata."""


@dataclass(frozen=True)
class Option:
    """Properties of an option for interfaces."""

    label: str
    """In the interface, in title case."""
    help: str
    """One or two sentences without the last full stop, for the interface and the command line."""
    default: Any
    """Default value, of the type of all values: bool, int, float or str."""
    name: str = ""
    """In .blend files and, with dashes, on the command line."""
    least: float = -np.inf
    most: float = np.inf
    """Bounds; values outside are rejected."""
    soft_least: float | None = None
    soft_most: float | None = None
    """Bounds of dragging a value."""
    unit: str = "NONE"
    """Blender's subtype of the property: ANGLE is in radians, and in degrees on the command line."""
    precision: int = 3
    """Digits after the point."""
    choices: Mapping[str, Any] | None = None
    """Choices by identifier; each has `number` (in .blend files) and `help`."""
    words: Mapping[str, Any] | None = None
    """Values with a word of their own on the command line, such as {"auto": 0}."""
    metavar: str = ""
    """Name of its value on the command line."""
    can_be_keyed: bool = True

    @property
    def kind(self) -> type:
        """bool, int, float or str."""
        return str if self.choices is not None else type(self.default)

    @property
    def initial(self) -> Any:
        """The default as interfaces keep it: the identifier of a choice."""
        held = {} if self.choices is None else {value: key for key, value in self.choices.items()}
        return held.get(self.default, self.default)

    def chosen(self, value: Any) -> Any:
        """Return the field's value for an interface's value: the choice, if the field holds choices."""
        return self.choices[value] if self.choices is not None and self.initial != self.default else value

    @property
    def phrase(self) -> str:
        """Its label within a sentence."""
        return " ".join(word if word.isupper() else word.lower() for word in self.label.split())

    def check(self, value: Any) -> None:
        """UserError for a value that is beyond the bounds, no number, or none of the choices."""
        if self.choices is not None and isinstance(value, str) and value not in self.choices:
            raise UserError(f"there is no {self.phrase} {value!r}; choose one of {', '.join(self.choices)}")
        if self.kind not in (int, float) or self.least <= value <= self.most:
            return
        scale, unit = (np.degrees(1), " degrees") if self.unit == "ANGLE" else (1, "")
        given, low, high = (
            f"{bound * scale:g}" if self.kind is float else f"{bound:.0f}"
            for bound in (value, self.least, self.most)
        )
        wanted = " a number"
        if np.isfinite(self.least):
            wanted = f" a number from {low} to {high}" if np.isfinite(self.most) else f" at least {low}"
        raise UserError(f"{self.phrase} cannot be {given}{unit}; give{wanted}")


def option(default: Any, label: str, text: str, **rest: Any) -> Any:
    """A field of a dataclass that is an option; `rest` are further fields of `Option`."""
    return field(default=default, metadata={KEY: Option(label, text, default, **rest)})


def options_of(group: type) -> dict[str, Option]:
    """The options of a dataclass by the name of their field, in its order."""
    return {each.name: each.metadata[KEY] for each in fields(group) if KEY in each.metadata}


def check(group: Any) -> None:
    """UserError for the first option of a dataclass's instance whose value is beyond its bounds."""
    for name, each in options_of(type(group)).items():
        each.check(getattr(group, name))
