"""The options of a lens on the command line, and the scene that gets it."""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import bpy

from ..core.base.counting import ranges
from ..core.base.errors import UserError
from ..core.base.streams import say
from ..core.camera.reconstruction import Reconstruction
from ..core.depth.user_maps import open_depth
from ..core.focus.focus import Focus, check_distance, check_points, largest_discs, sharp_distances
from ..core.focus.picking import unsolved
from ..core.focus.place import Place
from ..core.focus.pull import FocusMark
from ..core.frame.meshers import MESHERS
from ..core.frame.nearest_person import nearest_person
from ..core.frame.options import FRAME_OPTIONS
from ..core.frame.plan import FrameOptions
from ..core.frame.repaired_depth import repaired_subject
from ..core.frame.repairs import read_repairs
from ..core.media.clip import Footage, FrameRange, describe
from ..core.media.masks import open_masks
from ..core.sfm.workspace import Solve
from ..core.subjects.segmenter import Segmenter
from ..scene.base.timeline import go_to
from ..scene.build import build
from ..scene.focus import focus_marks
from ..scene.focus.clicks import place_at
from ..scene.lens import aperture_cloud
from ..scene.lens.lens import frame_options, registered
from ..scene.lens.repairs import add_repairs, repairs_of
from ..scene.properties import VirtualApertureSettings
from ..scene.sources import colour_space
from ..scene.sources.shot import shot_of
from ..scene.sources.subjects import mark_new, set_marked
from .aperture import set_shape
from .lens_options import DEFAULT_BLUR, place_of
from .subjects import focused_subjects, subjects_of


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


def lacking(footage: Footage, frames: FrameRange | None) -> list[str]:
    """Return what `--frames` asks for and the clip has not, as ranges."""
    if frames is None or not frames.of(footage.frames):
        return []
    clip = footage.whole().frames
    first, last = max(frames.first, clip[0]), min(frames.last, clip[-1])
    gaps = sorted(set(frames.of(range(first, last + 1))) - set(clip))
    before = [f"{frames.first}-{clip[0] - 1}"] if frames.first < clip[0] else []
    after = [f"{clip[-1] + 1}-{frames.last}"] if frames.last > clip[-1] else []
    return [*before, *([ranges(gaps)] if gaps else []), *after]


def movie_frames(footage: Footage, frames: FrameRange | None) -> list[int]:
    """Return the frames that a movie of those asked for shows: every one of the range.

    Those that the solve left out, which is of the frames of `footage`, get their camera from their
    neighbours.
    """
    wanted = wanted_frames(footage, frames)
    return all_frames(footage, FrameRange(wanted[0], wanted[-1]))


def all_frames(footage: Footage, frames: FrameRange | None) -> list[int]:
    """Return frames of the whole clip, also unsolved ones; UserError without any."""
    return list(footage.part(frames).frames)


def set_lens(
    settings: VirtualApertureSettings, solved: Solve, options: argparse.Namespace, frames: Sequence[int] = ()
) -> list[Place]:
    """Write the options into the settings, and return the picked places.

    UserError where the solve does not carry them.

    A place to focus on is in the first registered frame of `frames` (by default the clip's), unless the
    options name one.
    """
    reconstruction = solved.reconstruction
    _set_depth_maps(settings, solved, options)
    set_moving(settings, solved, options, frames)
    # The focus is picked on the repaired depth.
    _set_repairs(settings, reconstruction, options.repair)
    focus, frame, picked = _chosen_focus(settings, reconstruction, options, frames)
    focus = replace(focus, tilt=math.radians(options.tilt), swing=math.radians(options.swing))
    method = options.method or settings.method
    fewest = MESHERS[method].fewest_focus_points
    if len(focus.points) < fewest:
        raise UserError(
            f"the method {method} needs at least {fewest} focus points: use --focus-point, or"
            " --focus-at where there are points"
        )
    focus.inverse_depth(reconstruction, frame)
    focus_marks.set_focus(settings, focus, frame)
    if picked:
        focus_marks.replace_all(settings, map(FocusMark.of, picked))
    if options.aperture_radius is None:
        settings.blur = options.blur or DEFAULT_BLUR
    else:
        settings.aperture_radius = options.aperture_radius
    for name in FRAME_OPTIONS:
        if (value := getattr(options, name)) is not None:
            setattr(settings, name, value)
    set_shape(settings, options.aperture)
    aperture_cloud.update(settings)
    return picked


def _chosen_focus(
    settings: VirtualApertureSettings,
    reconstruction: Reconstruction,
    options: argparse.Namespace,
    frames: Sequence[int],
) -> tuple[Focus, int, list[Place]]:
    """The focus, its frame, and the picked places in their frames; `frames` are those of `set_lens`."""
    own = int(reconstruction.frames[0])
    if points := options.focus_point or options.focus_plane:
        focus = Focus(points=tuple(points), through_points=bool(options.focus_plane))
        check_points(reconstruction, focus.points)
        return focus, own, []
    if not options.focus_at and not options.focus_subject:
        if options.focus_distance is not None:
            check_distance(reconstruction, options.focus_distance)
        return Focus(distance=options.focus_distance), own, []
    found = []
    first = _registered(reconstruction, frames)
    for x, y, frame in map(place_of, options.focus_at or ()):
        found.append(place_at(settings.id_data, first if frame is None else frame, x, y)())
        if marked := mark_new(settings, found[-1:]):
            say(f"{marked} and in focus")
    for name, frame in focused_subjects(options):
        clip, at = shot_of(settings.id_data).context, first if frame is None else frame
        repairs = repairs_of(settings)
        is_marked = any(each.name == name for each in clip.marked)
        found.append(
            repaired_subject(clip, name, at, repairs) if is_marked else nearest_person(clip, at, repairs)
        )
    found.sort(key=lambda place: place.frame)
    for place in found:
        say(f"in focus: {place.distance:.4g} away at frame {place.frame}, from {place.source}")
    if len(found) == 1:
        return found[0].focus, found[0].frame, found
    # The aperture is chosen for the first one, and stays.
    return Focus(distance=found[0].distance), found[0].frame, found


def _set_repairs(
    settings: VirtualApertureSettings, reconstruction: Reconstruction, file: Path | None
) -> None:
    """Add the repairs of a file; UserError where one is of a frame without a camera."""
    made = read_repairs(file) if file else ()
    for each in made:
        if each.frame not in reconstruction.frames:
            raise UserError(f"{file}: {unsolved(reconstruction, each.frame)}")
    add_repairs(settings, made)


def _set_depth_maps(settings: VirtualApertureSettings, solved: Solve, options: argparse.Namespace) -> None:
    """Set the user's depth maps of the clip, and print notes on them."""
    if options.depth:
        maps = open_depth(options.depth.absolute(), solved.open_clip(solved.frames))
        for note in maps.notes:
            say(f"note: {note}")
        settings.depth_maps = str(options.depth.absolute())


def set_moving(
    settings: VirtualApertureSettings, solved: Solve, options: argparse.Namespace, frames: Sequence[int] = ()
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
    if options.segmenter:
        Segmenter(options.segmenter.absolute()).check()
        settings.segmenter = str(options.segmenter.absolute())
    settings.fixed = options.fixed is not False
    if (fixed := shot_of(settings.id_data).fixed) is not None:
        say(f"note: {fixed.note}")
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
    say(_discs(reconstruction, lens, frame))
    say(_sharp(reconstruction, lens, frame))


def _discs(reconstruction: Reconstruction, lens: FrameOptions, frame: int) -> str:
    """How large the blur is on either side of the focal plane: seldom alike."""
    width = reconstruction.intrinsics(reconstruction.image_at(frame)[0]).width
    parts = [
        f"{side * width:.1f} px ({100 * side:.1f}% of the width) {where}" if side > 0 else f"none {where}"
        for side, where in zip(
            largest_discs(reconstruction, lens.focus, frame, lens.radius, lens.zone),
            ("in front of the focus", "behind it"),
            strict=True,
        )
    ]
    return f"largest blur discs at frame {frame}: {', '.join(parts)}"


def _sharp(reconstruction: Reconstruction, lens: FrameOptions, frame: int) -> str:
    """Between which distances blur discs are too small to be seen."""
    near, far = sharp_distances(reconstruction, lens.focus, frame, lens.radius, lens.zone)
    where = " on the optical axis" if lens.focus.is_tilted else ""
    reach = f"from {near:.4g} and farther" if math.isinf(far) else f"from {near:.4g} to {far:.4g} away"
    return f"sharp at frame {frame}{where}: {'nothing' if math.isinf(near) else reach}"


def _registered(reconstruction: Reconstruction, frames: Sequence[int]) -> int:
    """The first of `frames` with a camera, or the nearest to the first of them."""
    own = reconstruction.frames
    return registered(reconstruction, [*(f for f in frames if f in own), *frames, int(own[0])][0])
