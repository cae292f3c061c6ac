"""The options of a lens on the command line, their checks, and files of them."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..core.base import atomic, numbers
from ..core.base.errors import UserError
from ..core.base.regular_file import read_regular
from ..core.focus.focus import FEWEST_IN_PLANE
from ..core.frame.options import FRAME_OPTIONS
from ..core.frame.repairs import KINDS, read_repairs
from ..core.media.fixed_area import FIXED
from .aperture import add_aperture, placed
from .blend import is_blend
from .options import Parser, UsageError, add_options, path, real, whole
from .subjects import add_focus_subject, add_subjects, focused_subjects

PATHS = ("depth", "mask", "repair", "segmenter")
"""Options that are paths."""
NEEDED = "focus_is_needed"
"""Attribute of parsed options: whether a focus must be given."""
DEFAULT_BLUR = 0.03
MOST_BLUR = 0.5
"""Image widths; larger discs are more than layers can be made for (`layered_mesh.WIDEST` on either side)."""


def add_lens(command: argparse.ArgumentParser, required: bool) -> None:
    """Add the options of focus, blur, depth and method; a focus may be `required`."""
    command.set_defaults(**{NEEDED: required})
    focus = command.add_mutually_exclusive_group()
    focus.add_argument(
        "--focus-at", metavar="X,Y[@FRAME]", action="append",
        help="place in the picture to focus on, from 0,0 (top left) to 1,1 (bottom right); given more than"
        " once, each with its frame, focus is pulled from one to the next",
    )  # fmt: skip
    focus.add_argument(
        "--focus-point", type=whole(0), nargs="+", metavar="ID", help="feature points to focus on"
    )
    focus.add_argument(
        "--focus-plane", type=whole(0), nargs="+", metavar="ID",
        help="three or more feature points for a tilted focal plane to pass through",
    )  # fmt: skip
    focus.add_argument(
        "--focus-distance", type=real, metavar="D", help="distance to focus at, in the model's own unit"
    )
    for name, side in (("--tilt", "upper"), ("--swing", "right")):
        command.add_argument(
            name, type=real, default=0.0, metavar="DEG",
            help=f"degrees by which the {side} part of the focal plane leans away, pivoting on the optical"
            f" axis",
        )  # fmt: skip
    blur = command.add_mutually_exclusive_group()
    blur.add_argument(
        "--blur", type=real, metavar="F",
        help=f"blur disc of the farthest background, as a fraction of the image width (default"
        f" {DEFAULT_BLUR})",
    )  # fmt: skip
    blur.add_argument(
        "--aperture-radius", type=real, metavar="R", help="aperture radius in the model's own unit"
    )
    command.add_argument(
        "--depth", type=path, metavar="PATH",
        help="your own depth maps of any scale and kind: a folder of EXR, PNG or .npz, or a single .npz or"
        " .zip; or a depth network (.onnx)",
    )  # fmt: skip
    command.add_argument(
        "--repair", type=path, metavar="FILE.json",
        help="strokes that mend mistakes of the depth and are carried through the clip: a JSON list of kind"
        f" ({', '.join(KINDS)}), frame, places, radius, amount, reference",
    )  # fmt: skip
    add_moving(command)
    add_focus_subject(command)
    add_options(command, FRAME_OPTIONS)
    add_aperture(command)


def add_moving(command: argparse.ArgumentParser) -> None:
    """Add the options of the clip that depth depends on: moving objects, and its colour space."""
    command.add_argument(
        "--mask",
        type=path,
        metavar="DIR",
        help="your own mattes of moving objects: images in which white or opaque moves, gray moves in part",
    )
    command.add_argument(
        "--segmenter", type=path, metavar="FILE.onnx",
        help="your own salient-object network, such as IS-Net or U2-Net, which cuts any object out of the"
        " clip from one click or stroke",
    )  # fmt: skip
    add_options(command, {FIXED.name: FIXED})
    add_subjects(command)
    command.add_argument(
        "--colour-space", "--color-space", metavar="NAME",
        help="what the clip was recorded in, by its name in Blender, such as 'S-Log3 S-Gamut3.Cine': cameras"
        " that record a log rarely say so in the file",
    )  # fmt: skip


def add_work(command: argparse.ArgumentParser) -> None:
    """Add the argument of a command that takes a solve, or a .blend of one."""
    command.add_argument(
        "work", type=path, metavar="DIR|FILE.blend",
        help="folder of the solve, or a .blend from save or farm, which has the lens",
    )  # fmt: skip


def lens_defaults() -> dict[str, Any]:
    """Return the options of `add_lens` as they are where none is given."""
    command = Parser()
    add_lens(command, required=False)
    return {name: value for name, value in vars(command.parse_args([])).items() if name != NEEDED}


def given_lens(options: argparse.Namespace) -> dict[str, Any]:
    """Return those of the options of `add_lens` that were given."""
    return {
        name: value
        for name, default in lens_defaults().items()
        if (value := getattr(options, name)) != default
    }


def check_lens(options: argparse.Namespace, required: bool) -> None:
    """Check the presence of a lens.

    Raises:
        UsageError: There is a lens beside a .blend, which has its own, or none although it is `required`
            beside a folder.
        UserError: As of `check_numbers`.
    """
    given = [f"--{name.replace('_', '-')}" for name in given_lens(options)]
    if given and is_blend(options.work):
        raise UsageError(f"{options.work.name} has its own lens, so leave out {', '.join(given)}; see --help")
    if not is_blend(options.work):
        setattr(options, NEEDED, required)
    check_numbers(options)


def write_lens(file: Path, given: dict[str, Any]) -> None:
    """Write options of `add_lens` for `read_lens`; paths are as seen from the file's folder."""
    text = json.dumps(given, indent=1, default=lambda path: path.as_posix())
    atomic.write_bytes(file, f"{text}\n".encode())


def read_lens(file: Path, options: argparse.Namespace) -> None:
    """Read options of `add_lens` from a file that `write_lens` wrote, or people edited.

    Raises:
        UserError: The file, which is named, holds anything else; else as of `check_numbers`.
    """
    try:
        held = json.loads(read_regular(file))
    except (OSError, ValueError, RecursionError) as error:
        raise UserError(f"{file} cannot be read as JSON: {error}") from None
    known = lens_defaults()
    for name, value in held.items() if isinstance(held, dict) else [("it", held)]:
        try:
            if name not in known:
                raise UserError("there is no such option")
            if name in FRAME_OPTIONS:
                FRAME_OPTIONS[name].check(value)
            setattr(options, name, file.absolute().parent / value if name in PATHS else value)
        except (UserError, TypeError) as error:
            raise UserError(f"{file}: {name} cannot be {value!r}: {error}") from None
    try:
        options.aperture = options.aperture and placed(options.aperture, file.absolute().parent)
        check_numbers(options)
    except (TypeError, AttributeError) as error:
        raise UserError(f"{file} has a value of a wrong kind: {error}") from None


def has_focus(options: argparse.Namespace) -> bool:
    """Return whether the options have a focus."""
    places = (options.focus_at, options.focus_point, options.focus_plane, options.focus_subject)
    return any(places) or options.focus_distance is not None


def check_numbers(options: argparse.Namespace) -> None:
    """Check everything that can be rejected before a long solve.

    Raises:
        UserError: A value is not valid.
        UsageError: A needed focus is missing.
    """
    if getattr(options, NEEDED) and not has_focus(options):
        raise UsageError(
            "one of --focus-at, --focus-point, --focus-plane, --focus-distance and --focus-subject is"
            " needed; see --help"
        )
    for name in ("blur", "aperture_radius", "focus_distance"):
        if (value := getattr(options, name)) is not None and not value > 0:
            raise UserError(f"--{name.replace('_', '-')} is {value:g}; it must be greater than zero")
    if options.blur is not None and options.blur > MOST_BLUR:
        meant = f"; for {options.blur:g}% write {options.blur / 100:g}" if options.blur >= 1 else ""
        raise UserError(
            f"the blur is {options.blur:g}, which is {100 * options.blur:g}% of the image width{meant};"
            f" at most {MOST_BLUR:g} can be drawn"
        )
    if options.repair:
        read_repairs(options.repair)
    _check_places(_focus_places(options))
    _check_tilt(options)


def _focus_places(options: argparse.Namespace) -> list[tuple[str, int | None]]:
    """The focus places in words, and their frames; UserError for options that are not valid together."""
    found = list[tuple[str, int | None]]()
    for x, y, frame in map(place_of, options.focus_at or ()):
        if not (0 <= x <= 1 and 0 <= y <= 1):
            raise UserError(f"focus at {x:g},{y:g} is outside the picture; both must be between 0 and 1")
        found.append((f"{x:g},{y:g}", frame))
    subjects = focused_subjects(options)
    if subjects and (options.focus_point or options.focus_plane or options.focus_distance is not None):
        raise UsageError("--focus-subject goes with --focus-at alone, not with points or a distance")
    return found + [(f"subject {name}", frame) for name, frame in subjects]


def _check_places(places: Sequence[tuple[str, int | None]]) -> None:
    """UserError for several places without different frames."""
    frames = [frame for _, frame in places]
    if len(frames) > 1 and None in frames:
        place = places[frames.index(None)][0]
        raise UserError(
            f"focus at {place} has no frame; a focus pull needs X,Y@FRAME or NAME@FRAME for each place,"
            f" such as {place.removeprefix('subject ')}@12"
        )
    if twice := sorted({frame for frame in frames if frame is not None and frames.count(frame) > 1}):
        raise UserError(f"two focus marks are at frame {twice[0]}; give each its own frame")


def _check_tilt(options: argparse.Namespace) -> None:
    """UserError for a focal plane that is none."""
    for name in ("tilt", "swing"):
        angle = getattr(options, name)
        if not -90 < angle < 90:
            raise UserError(f"the {name} is {angle:g} degrees; it must be between -90 and 90")
        if angle and options.focus_plane:
            raise UserError(f"the points of the focal plane set its tilt; leave out --{name}")
    if options.focus_plane and len(set(options.focus_plane)) < FEWEST_IN_PLANE:
        raise UserError(f"a focal plane through points takes {FEWEST_IN_PLANE} or more")


def place_of(text: str) -> tuple[float, float, int | None]:
    """From "X,Y" or "X,Y@FRAME"."""
    place, _, frame = text.partition("@")
    try:
        x, y = map(numbers.real, place.split(","))
        return x, y, numbers.whole(frame) if frame else None
    except ValueError:
        raise UserError(
            f"the focus {text!r} is not valid; write X,Y or X,Y@FRAME, such as 0.5,0.6@12"
        ) from None
