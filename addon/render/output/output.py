"""Frames and movies through Blender's own output: written beside, read back, only then moved into place."""

import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...core.base import atomic
from ...core.base.counting import counted, ranges
from ...core.base.errors import Remedy, UserError
from ...core.base.file_lock import OutputLock
from ...core.base.file_names import check_file, checked_name, leads_nowhere
from ...core.base.time_left import Clock
from ...core.frame.forecast import forecast
from ...core.media.clip import Footage
from ...core.media.picture_file import PICTURES
from ...core.media.sequence import is_pattern
from ...scene.base.timeline import go_to
from ...scene.lens.lens import frame_options
from ...scene.sources.shot import shot_of
from .. import engine
from ..cg import cg_process
from ..processes.jobs import Here
from ..views.frame_size import render_size, written_size
from . import frame_files, movie_file, movie_folder
from .movie_file import MOVIES, join

STILLS = {".png": "PNG", ".exr": "OPEN_EXR"}
Note = Callable[[str], None]
Draw = Callable[[list[int], Path, Here, Callable[[int], None]], None]
"""Renders frames to a path whose last #### is the frame number, in this process by `Here` and in others, and
reports each one."""


def check_output(out: Path, overwrite: bool, is_one: bool = False) -> None:
    """Check an output before any work.

    A picture's file has no #### where `is_one` frame is rendered.

    Raises:
        UserError: It cannot be written, or would overwrite something.
    """
    checked_name(out.absolute())
    suffix = out.suffix.lower()
    is_still = suffix in STILLS
    if suffix not in MOVIES and not is_still:
        raise UserError(f"{out.name} is not a known output format; end it in {', '.join([*MOVIES, *STILLS])}")
    if is_one and not is_still:
        raise UserError(f"{out.name} is a movie; a single picture is written to .png or .exr")
    if is_still and "#" not in out.name and not is_one:
        raise UserError(f"{out.name} is one file for many frames; write ####{suffix} for frame numbers")
    if not is_still:
        check_file(out)
        if out.exists() and not overwrite:
            raise UserError(f"{out} already exists; choose another file, or overwrite it", Remedy.OVERWRITE)
    check_folder(out.parent)
    if not is_still:
        movie_folder.check_free(out)


def check_apart(written: Iterable[Path], sources: Iterable[Path]) -> None:
    """Check that no output is a source, or the folder of a source's pictures.

    Sources are clips, masks and depth maps: videos, folders, patterns or one picture of a sequence.

    Raises:
        UserError: One is.
    """
    places = [
        source.parent if is_pattern(source) or source.suffix.lower() in PICTURES else source
        for source in (source.absolute() for source in sources)
    ]
    for path in written:
        for place in places:
            if path.resolve() == place.resolve() or (
                path.exists() and place.exists() and path.samefile(place)
            ):
                raise UserError(
                    f"{path} is one of the files the frames are made from; write to another folder, or"
                    " choose another file"
                )


def claimed(out: Path) -> AbstractContextManager[None]:
    """Hold an output for a run, within it; UserError naming the owner where another run has it.

    A sequence needs none: each frame is moved into place as a whole and knows what it was made from, so runs
    can write ranges of it side by side.
    """
    return OutputLock(out) if out.suffix.lower() in MOVIES else nullcontext()


def check_folder(folder: Path) -> None:
    """Check that a folder can be written, or made; UserError if it cannot."""
    # A link that leads nowhere, or in a circle, is there, too.
    above = next(p for p in [folder, *folder.parents] if os.path.lexists(p))
    if not above.is_dir():
        what = "a broken link" if leads_nowhere(above) else "not a folder"
        raise UserError(f"{above} is {what}, so {folder} cannot be written; choose another output folder")
    if not os.access(above, os.W_OK | os.X_OK):
        raise UserError(f"{above} cannot be written; choose another output folder")


@dataclass(frozen=True)
class Planned:
    """A planned render of frames."""

    views: tuple[int, int]
    """About the smallest and the largest number."""
    coarse: list[int]
    """Frames that are to be drawn in layers and have larger blur discs than those allow."""


def plan_all(scene: bpy.types.Scene, frames: list[int]) -> Planned:
    """Look at every frame's lens, so that what is wrong shows before an hour of rendering."""
    shot = shot_of(scene)
    if not any(layer.use for layer in scene.view_layers):
        raise UserError(f"no view layer of {scene.name} is rendered; enable Use for Rendering")
    size = render_size(scene.render)
    counts, coarse = [], []
    for frame in frames:
        # The focus may be keyed.
        go_to(scene, frame)
        lens = frame_options(scene.virtual_aperture, shot.reconstruction)
        expected = forecast(shot.context, frame, lens, size)
        counts.append(expected.views)
        if expected.is_too_large:
            coarse.append(frame)
    return Planned((min(counts), max(counts)), coarse)


def render_sequence(
    scene: bpy.types.Scene,
    frames: list[int],
    out: Path,
    overwrite: bool,
    report: Note,
    draw: Draw | None = None,
) -> None:
    """Render frames to files, each complete or not there.

    Existing frames are kept if their key shows equal inputs; others are replaced with `overwrite`, damaged
    ones always.

    Args:
        scene: The scene.
        frames: Numbers of frames.
        out: Path whose last #### is the frame number.
        overwrite: True to replace other frames.
        report: Called with lines.
        draw: Renders some frames in other processes.

    Raises:
        UserError: A frame, which is named, fails.
    """
    atomic.collect_orphans(out.parent)
    targets = {frame: out.with_name(numbered(out.name, frame)) for frame in frames}
    keys = frame_files.frame_keys(scene, frames)
    todo = {frame: _stamp(targets[frame]) for frame in _missing(targets, keys, overwrite, report)}
    set_still(scene, out.suffix.lower(), shot_of(scene).footage)
    clock = Clock("frames", len(todo), report)

    def here(frames: Sequence[int], done: Callable[[int], None]) -> None:
        with cg_process.kept():
            for frame in frames:
                if not _is_made_meanwhile(frame, targets[frame], keys[frame], todo[frame]):
                    _render_still(scene, frame, targets[frame], keys[frame], todo[frame])
                done(frame)

    if draw is not None and todo:
        draw(list(todo), out, here, clock.tick)
        check_frames({frame: targets[frame] for frame in todo}, written_size(scene.render), keys)
        return
    here(list(todo), clock.tick)
    for frame, path in targets.items():
        _check_ours(frame, path, keys[frame])


def check_frames(files: dict[int, Path], size: tuple[int, int], keys: dict[int, str] | None = None) -> None:
    """Check rendered files.

    Args:
        files: Paths by frame.
        size: (width, height).
        keys: Expected keys by frame, if other inputs are errors.

    Raises:
        UserError: Files are missing, damaged, of another size, or not as this program wrote them; their
            frames are named.
    """
    problems: dict[str, list[int]] = {}
    for frame, path in files.items():
        problem = frame_files.still_problem(path, size) or _strangeness(path, keys[frame] if keys else None)
        if problem:
            problems.setdefault(problem.replace("was not written", "is missing"), []).append(frame)
    if problems:
        listed = "; ".join(
            f"{'frame' if len(which) == 1 else 'each of frames'} {ranges(which)} {problem}"
            for problem, which in problems.items()
        )
        raise UserError(f"{listed} in {next(iter(files.values())).parent}; render those frames again")


def _strangeness(path: Path, key: str | None) -> str:
    """Why a picture is not one that this program wrote, with that key, or an empty string."""
    found = frame_files.key_of(path)
    if found is None:
        return "was not rendered by this program"
    if key is not None and found != key:
        return "was made from other inputs or with other settings"
    return "was changed after it was rendered" if frame_files.is_changed(path) else ""


def _missing(targets: dict[int, Path], keys: dict[int, str], overwrite: bool, report: Note) -> list[int]:
    """Frames that are to be rendered; UserError where others' files would be replaced unasked."""
    todo, damaged = [], 0
    for frame, path in targets.items():
        check_file(path)
        if not path.exists():
            todo.append(frame)
            continue
        is_same = frame_files.key_of(path) == keys[frame]
        problem = frame_files.still_problem(path) if is_same or not path.stat().st_size else ""
        strange = "" if problem else _strangeness(path, keys[frame])
        if not (problem or strange):
            continue
        if not (problem or overwrite):
            raise UserError(
                f"{path} already exists and {strange}; choose another folder, or overwrite it",
                Remedy.OVERWRITE,
            )
        damaged += bool(problem)
        todo.append(frame)
    if len(todo) < len(targets):
        report(f"{counted(len(targets) - len(todo), 'frame')} there already")
    if damaged:
        report(f"{counted(damaged, 'frame')} there but damaged or empty: rendered again")
    return todo


_Stamp = tuple[int, int, int]


def _stamp(path: Path) -> _Stamp | None:
    """Inode, size and time of a file; None where there is none."""
    try:
        state = path.stat()
    except FileNotFoundError:
        return None
    return state.st_ino, state.st_size, state.st_mtime_ns


def _is_made_meanwhile(frame: int, target: Path, key: str, stamp: _Stamp | None) -> bool:
    """Return whether an equal run has made a frame since; UserError if an unequal one has."""
    now = _stamp(target)
    if now is None or now == stamp:
        return False
    _check_ours(frame, target, key)
    return not frame_files.still_problem(target)


def _check_ours(frame: int, target: Path, key: str) -> None:
    """UserError where a frame's file is not the one of the key."""
    if not target.exists() or frame_files.key_of(target) != key:
        raise UserError(
            f"frame {frame}: {target} was replaced in the meantime, perhaps by a run with other settings;"
            " stop that one, or choose another folder"
        )


def _render_still(scene: bpy.types.Scene, frame: int, target: Path, key: str, stamp: _Stamp | None) -> None:
    """One frame into its file; UserError, naming the frame, where anything is wrong with it."""
    render = scene.render
    go_to(scene, frame)
    render.use_stamp_note, render.stamp_note_text = True, frame_files.note_of(key)
    with atomic.staged(target) as part:
        render.filepath = frame_files.blender_path(part)
        with engine.watched() as watch:
            try:
                bpy.ops.render.render(write_still=True, scene=scene.name)
            except RuntimeError as error:
                watch.raise_error()
                raise UserError(f"frame {frame}: Blender could not write it: {str(error).strip()}") from error
        watch.check_drawn()
        frame_files.refuse(target, frame_files.still_problem(part, written_size(render)))
        frame_files.seal(part)
        _is_made_meanwhile(frame, target, key, stamp)


def render_movie(
    scene: bpy.types.Scene, frames: list[int], out: Path, report: Note, draw: Draw | None = None
) -> None:
    """Render a movie with the clip's rate, sound and dynamic range.

    A gap in the clip holds the frame before.

    The frames are kept beside it as pictures until the movie is whole, so that an equal run goes on where
    this one stopped.
    """
    folder = movie_folder.prepare(out)
    crop_to_even(scene.render)
    # Pictures of another run of the same movie are replaced.
    suffix = ".exr" if movie_file.hdr_display(scene) else ".png"
    pattern = folder / f"{movie_folder.FRAMES}{suffix}"
    render_sequence(scene, frames, pattern, True, report, draw)
    join(scene, {frame: folder / numbered(pattern.name, frame) for frame in frames}, out)
    if left := movie_folder.clear(out):
        report(f"{folder} stays: {left[0].name} in it was not made by this run, or was changed since")


def set_still(scene: bpy.types.Scene, suffix: str, footage: Footage) -> None:
    """Set the output to PNG or EXR, by the suffix, as deep as the clip, without time stamps."""
    settings = scene.render.image_settings
    # Each view would have a separate file.
    scene.render.use_multiview = False
    settings.media_type = "IMAGE"
    settings.file_format = STILLS[suffix]
    settings.color_mode = "RGBA" if suffix == ".exr" else "RGB"
    deep = footage.read(footage.frames[0]).dtype != "uint8"
    settings.color_depth = {".png": "16" if deep else "8", ".exr": "32" if deep else "16"}[suffix]
    frame_files.set_no_stamps(scene.render)


def crop_to_even(render: bpy.types.RenderSettings) -> None:
    """Crop to even sides: H.264 stores colour for two by two pixels."""
    across, down = written_size(render)
    if not (across % 2 or down % 2):
        return
    if not (render.use_border and render.use_crop_to_border):
        render.use_border = render.use_crop_to_border = True
        render.border_min_x = render.border_min_y = 0.0
        render.border_max_x = render.border_max_y = 1.0
    width, height = render_size(render)
    render.border_max_x = (round(render.border_max_x * width) - across % 2) / width
    render.border_min_y = (round(render.border_min_y * height) + down % 2) / height


def numbered(name: str, frame: int) -> str:
    """Return the last #### of a name replaced by the frame number, as Blender does; without any it stays."""
    if "#" not in name:
        return name
    end = name.rindex("#") + 1
    start = len(name[:end].rstrip("#"))
    return name[:start] + f"{frame:0{end - start}d}" + name[end:]
