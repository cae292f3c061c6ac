"""Options for the user, each declared once as a field of a dataclass.

The Blender property, the option of the command line, the key of a preset and the check of bounds are made
from the field. A new option is one field, and a row in a panel if it is shown:

>>> @dataclass(frozen=True)
... class Sharpening:
...     amount: float = option(0.5, "Sharpening", "How much edges are raised", least=0.0, most=2.0)
>>> check(Sharpening(3.0))
Traceback (most recent call last):
UserError: sharpening cannot be 3; give a number from 0 to 2
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from .errors import UserError

KEY = "option"
"""Key of an option in a field's metadata."""


@dataclass(frozen=True)
class Option:
    """The description of an option for all interfaces."""

    label: str
    """Title case."""
    help: str
    """One or two sentences without the last full stop."""
    default: Any
    """bool, int, float or str, as all values of the option."""
    name: str = ""
    """Name in .blend files and, with dashes, on the command line."""
    least: float = -np.inf
    most: float = np.inf
    """Bounds; values outside are rejected."""
    soft_least: float | None = None
    soft_most: float | None = None
    """Bounds when dragging the value."""
    unit: str = "NONE"
    """Blender's subtype of the property: ANGLE is in radians, and in degrees on the command line."""
    precision: int = 3
    """Digits after the decimal point."""
    choices: Mapping[str, Any] | None = None
    """Choices by identifier; each has `number` (in .blend files) and `help`."""
    words: Mapping[str, Any] | None = None
    """Special values on the command line, such as {"auto": 0}."""
    metavar: str = ""
    """Placeholder of the value on the command line."""
    can_be_keyed: bool = True

    @property
    def kind(self) -> type:
        """Type of the values: bool, int, float or str."""
        return str if self.choices is not None else type(self.default)

    @property
    def initial(self) -> Any:
        """The default as interfaces store it: for choices, the identifier."""
        held = {} if self.choices is None else {value: key for key, value in self.choices.items()}
        return held.get(self.default, self.default)

    def chosen(self, value: Any) -> Any:
        """Convert an interface's value to the field's value, which may be the choice itself."""
        return self.choices[value] if self.choices is not None and self.initial != self.default else value

    @property
    def phrase(self) -> str:
        """The label within a sentence."""
        return " ".join(word if word.isupper() else word.lower() for word in self.label.split())

    def check(self, value: Any) -> None:
        """Raise UserError for a value outside the bounds, not a number, or not a choice."""
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
    """Make a field of a dataclass that is an option; `rest` are further fields of `Option`."""
    return field(default=default, metadata={KEY: Option(label, text, default, **rest)})


def options_of(group: type) -> dict[str, Option]:
    """Return the options of a dataclass by field name, in its order."""
    return {each.name: each.metadata[KEY] for each in fields(group) if KEY in each.metadata}


def check(group: Any) -> None:
    """Raise UserError for the first invalid option of a dataclass's instance."""
    for name, each in options_of(type(group)).items():
        each.check(getattr(group, name))
