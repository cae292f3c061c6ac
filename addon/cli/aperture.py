"""The shape of the aperture on the command line: `--aperture blades=6 rotation=15`."""

import argparse
import math
from pathlib import Path

from ..core.base.options import Option
from ..core.frame.options import APERTURE_OPTIONS
from ..scene.properties import VirtualApertureSettings
from .options import path, value_type

IMAGE = "image"


def _bounds(option: Option) -> str:
    if option.unit == "ANGLE":
        return "degrees"
    return f"{option.least:g} to {option.most:g}" if math.isfinite(option.most - option.least) else "a number"


def add_aperture(command: argparse.ArgumentParser) -> None:
    """Add `--aperture KEY=VALUE ...`."""
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
        raise argparse.ArgumentTypeError(f"{text!r} is not valid; write KEY=VALUE with one of {keys}")
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
    # A picture that cannot be read is refused now.
    assert settings.shape.aperture is not None


def image_of(words: list[str] | None) -> Path | None:
    """Return the picture that the words of `--aperture` name, if they name one."""
    return next((Path(value) for key, value in reversed(_pairs(words)) if key == IMAGE), None)


def with_image(words: list[str], image: Path) -> list[str]:
    """Return the words of `--aperture` with another picture."""
    return [*(word for word in words if not word.startswith(f"{IMAGE}=")), f"{IMAGE}={image.as_posix()}"]


def placed(words: list[str], folder: Path) -> list[str]:
    """Return the words of `--aperture` with the path of a picture as seen from a folder."""
    image = image_of(words)
    return words if image is None else with_image(words, folder / image)


def _pairs(words: list[str] | None) -> list[tuple[str, str]]:
    return [(key, value) for key, _, value in (word.partition("=") for word in words or [])]
