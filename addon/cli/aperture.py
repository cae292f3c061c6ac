"""The shape of the aperture on the command line: `--aperture blades=6 rotation=15`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from ..core.base.errors import UserError
from ..core.lens.aperture import Aperture
from ..core.media.copying import copy_file
from ..scene.aperture_shape import NUMBERS
from ..scene.properties import VirtualApertureSettings
from .options import real
from .paths import path

IMAGE = "image"
FOLDER = "aperture"
"""Beside a .blend or in a farm's bundle, for a copy of the aperture's picture."""
HELP = (
    "shape of the aperture: blades (3 to 16), rotation (degrees), roundness (0 to 1), ratio (1 to 10,"
    " anamorphic), obstruction (0 to 0.95, a mirror lens), apodisation (0 to 0.99), spherical_aberration (-1"
    " creamy to 1 soap bubbles), vignetting (0 to 1, cat's eyes), image (a picture in place of blades)"
)


def add_aperture(command: argparse.ArgumentParser) -> None:
    """`--aperture KEY=VALUE ...`"""
    command.add_argument("--aperture", nargs="+", type=_word, metavar="KEY=VALUE", help=HELP)


def _word(text: str) -> str:
    """KEY=VALUE, checked; the path of a picture made absolute, for other processes in whichever folder."""
    key, sign, value = text.partition("=")
    if not sign or key not in (*NUMBERS, IMAGE):
        keys = ", ".join((*NUMBERS, IMAGE))
        raise argparse.ArgumentTypeError(f"{text!r} is not understood; write KEY=VALUE with one of {keys}")
    if key == IMAGE:
        return f"{key}={path(value).absolute()}"
    try:
        real(value)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"the aperture's {key} {error}") from None
    return text


def set_shape(settings: VirtualApertureSettings, words: list[str] | None) -> None:
    """Write the words of `--aperture` into the settings; UserError for a shape that means nothing."""
    told = dict(_pairs(words))
    settings.shape.image = told.pop(IMAGE, settings.shape.image)
    numbers: dict[str, Any] = {key: float(value) for key, value in told.items()}
    if "blades" in numbers:
        if not numbers["blades"].is_integer():
            raise UserError(f"the aperture's blades are {told['blades']}; they must be a whole number")
        numbers["blades"] = int(numbers["blades"])
    if "rotation" in numbers:
        numbers["rotation"] = math.radians(numbers["rotation"])
    # Blender would keep to its bounds in silence.
    Aperture(**numbers)
    for key, number in numbers.items():
        setattr(settings.shape, key, number)
    # A picture that cannot be read is told now.
    assert settings.shape.aperture is not None


def copy_image(words: list[str] | None, folder: Path) -> tuple[list[str], Path | None]:
    """The words of `--aperture` with the picture's copy in a folder, and that copy, if there is a picture."""
    pairs, copy = _pairs(words), None
    for place, (key, value) in enumerate(pairs):
        if key == IMAGE:
            copy = folder / FOLDER / Path(value).name
            copy_file(Path(value), copy)
            pairs[place] = key, str(copy)
    return [f"{key}={value}" for key, value in pairs], copy


def _pairs(words: list[str] | None) -> list[tuple[str, str]]:
    return [(key, value) for key, _, value in (word.partition("=") for word in words or [])]
