"""The shape of the aperture on the command line: `--aperture blades=6 rotation=15`."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from ..core.base.options import Option
from ..core.frame.options import APERTURE_OPTIONS
from ..core.media.copying import copy_file
from ..scene.properties import VirtualApertureSettings
from .options import value_type
from .paths import path

IMAGE = "image"
FOLDER = "aperture"
"""Beside a .blend or in a farm's bundle, for a copy of the aperture's picture."""


def _bounds(option: Option) -> str:
    if option.unit == "ANGLE":
        return "degrees"
    return f"{option.least:g} to {option.most:g}" if math.isfinite(option.most - option.least) else "a number"


def add_aperture(command: argparse.ArgumentParser) -> None:
    """`--aperture KEY=VALUE ...`"""
    keys = [f"{key} ({_bounds(each)}): {each.help}" for key, each in APERTURE_OPTIONS.items()]
    command.add_argument(
        "--aperture", nargs="+", type=_word, metavar="KEY=VALUE",
        help="shape of the aperture; " + "; ".join([*keys, f"{IMAGE}: a picture in place of blades"]),
    )  # fmt: skip


def _word(text: str) -> str:
    """KEY=VALUE, checked; the path of a picture made absolute, for other processes in whichever folder."""
    key, sign, value = text.partition("=")
    if not sign or key not in (*APERTURE_OPTIONS, IMAGE):
        keys = ", ".join((*APERTURE_OPTIONS, IMAGE))
        raise argparse.ArgumentTypeError(f"{text!r} is not understood; write KEY=VALUE with one of {keys}")
    if key == IMAGE:
        return f"{key}={path(value).absolute()}"
    try:
        value_type(APERTURE_OPTIONS[key])(value)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"of the aperture's {key}: {error}") from None
    return text


def set_shape(settings: VirtualApertureSettings, words: list[str] | None) -> None:
    """Write the words of `--aperture` into the settings; UserError for a shape that means nothing."""
    for key, value in _pairs(words):
        setattr(settings.shape, key, value if key == IMAGE else value_type(APERTURE_OPTIONS[key])(value))
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
