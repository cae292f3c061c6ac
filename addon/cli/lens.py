"""The options of a lens on the command line, and the scene that gets it."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..core.base import atomic, numbers
from ..core.base.errors import UserError
from ..core.base.regular_file import read_regular
from ..core.base.streams import say
from ..core.camera.reconstruction import Reconstruction
from ..core.depth.user_maps import open_depth
from ..core.focus.focus import (
    FEWEST_IN_PLANE,
    Focus,
    check_distance,
    check_points,
    largest_discs,
    radius_for_blur,
    sharp_distances,
)
from ..core.focus.place import Place
from ..core.focus.pull import FocusMark
from ..core.frame.meshers import MESHERS
from ..core.frame.options import FRAME_OPTIONS
from ..core.media.clip import Footage, FrameRange, describe, open_footage
from ..core.media.masks import open_masks
from ..core.sfm.workspace import Solve
from ..scene.base.timeline import go_to
from ..scene.build import build
from ..scene.focus import focus_marks
from ..scene.focus.clicks import place_at
from ..scene.lens import aperture_cloud
from ..scene.lens.lens import frame_options, set_aperture, set_focus
from ..scene.properties import VirtualApertureSettings
from ..scene.sources import colour_space
from ..scene.sources.shot import shot_of
from ..scene.sources.subjects import mark_new, set_marked
from .aperture import add_aperture, placed, set_shape
from .blend import is_blend
from .options import Parser, UsageError, add_options, real, whole
from .paths import path
from .subjects import add_focus_subject, add_subjects, focused_subjects, subjects_of

NEEDED = "focus_is_needed"
"""Attribute of parsed options: whether a focus must be given."""
DEFAULT_BLUR = 0.03
MOST_BLUR = 0.5
"""Image widths; larger discs are more than layers can be made for (`layered_mesh.WIDEST` on either
side)."""


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
            setattr(options, name, file.absolute().parent / value if name in ("depth", "mask") else value)
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


def scene_of(solved: Solve) -> tuple[bpy.types.Scene, VirtualApertureSettings, Footage]:
    """Return a fresh scene that holds the solve."""
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    footage = solved.open_clip(solved.frames)
    settings = build(scene, footage, solved.reconstruction)
    settings.work_dir = str(solved.work_dir)
    return scene, settings, footage


def wanted_frames(footage: Footage, frames: FrameRange | None) -> tuple[int, ...]:
    """Return the frames of a clip that `--frames` asks for, by default all.

    Raises:
        UserError: There are none.
    """
    wanted = footage.frames if frames is None else footage.of(frames)
    if not wanted:
        raise UserError(f"the solve has no frames {frames}; it has {describe(footage.frames)}")
    return wanted


def movie_frames(footage: Footage, frames: FrameRange | None) -> list[int]:
    """Return the frames that a movie of those asked for shows: every one of the range.

    Those that the solve left out, which is of the frames of `footage`, get their camera from their
    neighbours.
    """
    wanted = wanted_frames(footage, frames)
    return all_frames(footage, FrameRange(wanted[0], wanted[-1]))


def all_frames(footage: Footage, frames: FrameRange | None) -> list[int]:
    """Return frames of the whole clip, also unsolved ones.

    Raises:
        UserError: There are none.
    """
    return list(open_footage(footage.path, frames, info=footage.video, stills=footage.is_stills).frames)


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
    for name, value in (("--blur", options.blur), ("--aperture-radius", options.aperture_radius)):
        if value is not None and not value > 0:
            raise UserError(f"{name} is {value:g}; it must be greater than zero")
    if options.blur is not None and options.blur > MOST_BLUR:
        meant = f"; for {options.blur:g}% write {options.blur / 100:g}" if options.blur >= 1 else ""
        raise UserError(
            f"the blur is {options.blur:g}, which is {100 * options.blur:g}% of the image width{meant};"
            f" at most {MOST_BLUR:g} can be drawn"
        )
    if options.target_psnr and options.views:
        raise UserError("give the number of views or the target quality, not both")
    if options.focus_distance is not None and not options.focus_distance > 0:
        raise UserError(f"--focus-distance is {options.focus_distance:g}; it must be greater than zero")
    _check_places(_focus_places(options))
    _check_tilt(options)


def _focus_places(options: argparse.Namespace) -> list[tuple[str, int | None]]:
    """The focus places in words, and their frames.

    UserError for invalid words, places outside of the picture, and a subject beside points or a distance.
    """
    found = list[tuple[str, int | None]]()
    for x, y, frame in map(_place, options.focus_at or ()):
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


def set_lens(
    settings: VirtualApertureSettings,
    solved: Solve,
    options: argparse.Namespace,
    frames: Sequence[int] = (),
) -> None:
    """Write the options into the settings; UserError where the solve does not carry them.

    A place to focus on is in the first registered frame of `frames` (by default the clip's), unless the
    options name one.
    """
    reconstruction = solved.reconstruction
    _set_depth_maps(settings, solved, options)
    set_moving(settings, solved, options, frames)
    focus, frame, places = _chosen_focus(settings, reconstruction, options, frames)
    focus = replace(focus, tilt=math.radians(options.tilt), swing=math.radians(options.swing))
    method = options.method or settings.method
    fewest = MESHERS[method].fewest_focus_points
    if len(focus.points) < fewest:
        raise UserError(
            f"the method {method} needs at least {fewest} focus points: use --focus-point, or"
            " --focus-at where there are points"
        )
    radius = options.aperture_radius
    if radius is None:
        radius = radius_for_blur(reconstruction, focus, frame, options.blur or DEFAULT_BLUR)
    set_focus(settings, focus, frame)
    if places:
        focus_marks.replace_all(settings, map(FocusMark.of, places))
    blur = None if options.aperture_radius is not None else options.blur or DEFAULT_BLUR
    set_aperture(settings, radius, blur)
    for name in FRAME_OPTIONS:
        if (value := getattr(options, name)) is not None:
            setattr(settings, name, value)
    set_shape(settings, options.aperture)
    aperture_cloud.update(settings)


def _chosen_focus(
    settings: VirtualApertureSettings,
    reconstruction: Reconstruction,
    options: argparse.Namespace,
    frames: Sequence[int],
) -> tuple[Focus, int, list[Place]]:
    """The focus, its frame, and the picked places, each in its frame.

    `frames` are those of `set_lens`.
    """
    own = int(reconstruction.frames[0])
    if points := options.focus_point or options.focus_plane:
        focus = Focus(points=tuple(points), through_points=bool(options.focus_plane))
        check_points(reconstruction, focus.points)
        return focus, own, []
    if not options.focus_at and not options.focus_subject:
        if options.focus_distance is not None:
            check_distance(reconstruction, options.focus_distance, "--focus-distance")
        return Focus(distance=options.focus_distance), own, []
    found = []
    first = _registered(reconstruction, frames)
    for x, y, frame in map(_place, options.focus_at or ()):
        finder = shot_of(settings.id_data).context.places(first if frame is None else frame)
        found.append(place_at(settings.id_data, finder, x, y)())
        if marked := mark_new(settings, found[-1:]):
            say(f"{marked} and in focus")
    for name, frame in focused_subjects(options):
        found.append(shot_of(settings.id_data).context.subject_place(name, first if frame is None else frame))
    found.sort(key=lambda place: place.frame)
    for place in found:
        say(f"in focus: {place.distance:.4g} away at frame {place.frame}, from {place.source}")
    if len(found) == 1:
        return found[0].focus, found[0].frame, found
    # The aperture is chosen for the first one, and stays.
    return Focus(distance=found[0].distance), found[0].frame, found


def _set_depth_maps(settings: VirtualApertureSettings, solved: Solve, options: argparse.Namespace) -> None:
    """Set the user's depth maps of the clip, and print notes on them."""
    if options.depth:
        maps = open_depth(options.depth.absolute(), solved.open_clip(solved.frames))
        for note in maps.notes:
            say(f"note: {note}")
        settings.depth_maps = str(options.depth.absolute())


def set_moving(
    settings: VirtualApertureSettings,
    solved: Solve,
    options: argparse.Namespace,
    frames: Sequence[int] = (),
) -> None:
    """Write the options of `add_moving` into the settings, and print notes on masks.

    Args:
        settings: The settings.
        solved: The solve.
        options: Those of the command.
        frames: As of `set_lens`.

    Raises:
        UserError: A stroke or colour space is not valid, or a mask cannot be read.
    """
    if options.colour_space:
        settings.colour_space = colour_space.checked(options.colour_space)
        colour_space.colour_space(settings.colour_space)
    set_marked(settings, subjects_of(options, _registered(solved.reconstruction, frames)))
    if options.mask:
        masks = open_masks(options.mask.absolute(), solved.open_clip(solved.frames))
        for note in masks.notes:
            say(f"note: {note}")
        settings.masks = str(options.mask.absolute())


def say_lens(
    settings: VirtualApertureSettings, reconstruction: Reconstruction, frames: Sequence[int] = ()
) -> None:
    """Print the sizes of blur discs and the sharp range.

    They are those of the first registered frame of `frames` (by default the clip's), with its focus.
    """
    scene, frame = settings.id_data, _registered(reconstruction, frames)
    before, subframe = scene.frame_current, scene.frame_subframe
    go_to(scene, frame)
    lens = frame_options(settings, reconstruction)
    scene.frame_set(before, subframe=subframe)
    say(_discs(reconstruction, lens.focus, frame, lens.radius))
    say(_sharp(reconstruction, lens.focus, frame, lens.radius))


def _discs(reconstruction: Reconstruction, focus: Focus, frame: int, radius: float) -> str:
    """How large the blur is on either side of the focal plane: seldom alike."""
    width = reconstruction.intrinsics(reconstruction.image_at(frame)[0]).width
    parts = [
        f"{side * width:.1f} px ({100 * side:.1f}% of the width) {where}" if side > 0 else f"none {where}"
        for side, where in zip(
            largest_discs(reconstruction, focus, frame, radius),
            ("in front of the focus", "behind it"),
            strict=True,
        )
    ]
    return f"largest blur discs at frame {frame}: {', '.join(parts)}"


def _sharp(reconstruction: Reconstruction, focus: Focus, frame: int, radius: float) -> str:
    """Between which distances blur discs are too small to be seen."""
    near, far = sharp_distances(reconstruction, focus, frame, radius)
    where = " on the optical axis" if focus.is_tilted else ""
    reach = f"from {near:.4g} and farther" if math.isinf(far) else f"from {near:.4g} to {far:.4g} away"
    return f"sharp at frame {frame}{where}: {'nothing' if math.isinf(near) else reach}"


def _registered(reconstruction: Reconstruction, frames: Sequence[int]) -> int:
    """The first of `frames` with a camera, or the nearest to the first of them."""
    own = reconstruction.frames
    found = [frame for frame in frames if frame in own]
    if found or not len(frames):
        return int(found[0] if found else own[0])
    return int(own[np.abs(own - frames[0]).argmin()])


def _place(text: str) -> tuple[float, float, int | None]:
    """From "X,Y" or "X,Y@FRAME"."""
    place, _, frame = text.partition("@")
    try:
        x, y = map(numbers.real, place.split(","))
        return x, y, numbers.whole(frame) if frame else None
    except ValueError:
        raise UserError(
            f"the focus {text!r} is not valid; write X,Y or X,Y@FRAME, such as 0.5,0.6@12"
        ) from None
