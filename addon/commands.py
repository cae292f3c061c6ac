"""The commands of the command line."""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import sys
from pathlib import Path

import bpy

from . import commands_solve
from .core.depth_maps import open_depth
from .core.errors import UserError
from .core.focus import Focus, check_points, pick, radius_for_blur
from .core.footage import Footage, FrameRange, open_footage
from .core.masks import open_masks
from .core.solve_folder import Solve, default_work_dir, load_solve
from .core.solve_report import ranges
from .core.views import METHODS, LensSettings, check_settings
from .render import output
from .render.average import no_gpu_note
from .render.gpu_views import gpu_problem
from .render.quiet import quiet
from .scene import aperture_cloud
from .scene.build import build, make_paths_relative
from .scene.properties import VirtualApertureSettings, set_focus

DEFAULT_BLUR = 0.03


def parser() -> argparse.ArgumentParser:
    """All commands; each sets `command` to the function that runs it."""
    top = argparse.ArgumentParser(prog="headless.py", description="Depth of field for all-sharp video.")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show a traceback with errors")
    commands = top.add_subparsers(required=True, metavar="COMMAND")

    commands_solve.add_commands(commands, common)
    two = commands.add_parser("render", parents=[common], help="render a solved clip with depth of field")
    two.add_argument("work", type=Path, metavar="DIR", help="folder that keeps the solve")
    _add_lens(two, required=True)
    two.add_argument("--frames", metavar="A-B[:STEP]", help="frames to render")
    _add_output(two)
    two.set_defaults(command=render)

    three = commands.add_parser("run", parents=[common], help="solve and render")
    commands_solve.add_footage(three)
    three.add_argument("--work", type=Path, metavar="DIR", help="default: CLIP.aperture beside the output")
    three.add_argument("--frames", metavar="A-B[:STEP]", help="frames of the clip to solve and render")
    _add_lens(three, required=True)
    _add_output(three)
    three.set_defaults(command=run)

    four = commands.add_parser(
        "save", parents=[common], help="save the solved clip as a .blend, ready to open or to send"
    )
    four.add_argument("work", type=Path, metavar="DIR", help="folder that keeps the solve")
    four.add_argument("--blend", type=Path, required=True, metavar="FILE")
    four.add_argument("--overwrite", action="store_true", help="replace the .blend if it exists")
    _add_lens(four, required=False)
    four.set_defaults(command=save)
    return top


def _add_lens(command: argparse.ArgumentParser, required: bool) -> None:
    focus = command.add_mutually_exclusive_group(required=required)
    focus.add_argument(
        "--focus-at", metavar="X,Y[@FRAME]", help="place in the picture, 0,0 top left, 1,1 bottom right"
    )
    focus.add_argument("--focus-point", type=int, nargs="+", metavar="ID", help="feature points in focus")
    focus.add_argument("--focus-distance", type=float, metavar="D", help="depth in scene units")
    blur = command.add_mutually_exclusive_group()
    blur.add_argument(
        "--blur", type=float, metavar="F",
        help=f"farthest background's blur disc as a share of the image width (default {DEFAULT_BLUR})",
    )  # fmt: skip
    blur.add_argument(
        "--aperture-radius", type=float, metavar="R", help="radius of the aperture in scene units"
    )
    command.add_argument(
        "--depth", type=Path, metavar="DIR", help="your own depth maps: EXR or 16-bit PNG, any scale and kind"
    )
    command.add_argument(
        "--mask",
        type=Path,
        metavar="DIR",
        help="your own masks of what moves by itself: pictures, white moves",
    )
    command.add_argument("--views", default="auto", metavar="N|auto", help="virtual cameras a frame")
    command.add_argument(
        "--method", choices=METHODS, default=METHODS[0],
        help="layers (default): depth of every pixel; features: one coarse mesh, fast; grid: one regular mesh"
        " that follows the features as stiffly as the picture allows (Liu 2009); edges: triangles along image"
        " edges (thesis, section 5.2); thesis: the 2010 baseline",
    )  # fmt: skip
    command.add_argument(
        "--borrow", choices=("on", "off"), default="on", help="take what a frame hides from others (on)"
    )
    command.add_argument("--seed", type=int, default=0, help="of the thesis's random positions")


def _add_output(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE.mp4|DIR/####.png|DIR/####.exr")
    command.add_argument("--overwrite", action="store_true", help="replace output that exists")


def render(options: argparse.Namespace) -> None:
    """`render DIR ... --out OUT`"""
    output.check_output(options.out, options.overwrite)
    _check_numbers(options)
    _render(load_solve(options.work), options)


def run(options: argparse.Namespace) -> None:
    """`run FOOTAGE ... --out OUT`"""
    output.check_output(options.out, options.overwrite)
    _check_numbers(options)
    solved = commands_solve.solve_clip(
        options, options.work or default_work_dir(options.footage, options.out.absolute().parent)
    )
    _say(solved.summary)
    _render(solved, options)


def save(options: argparse.Namespace) -> None:
    """`save DIR --blend FILE`: the .blend, and the clip beside it, so that the folder is all there is."""
    blend: Path = options.blend.absolute()
    if blend.suffix.lower() != ".blend":
        raise UserError(f"{blend.name} must end in .blend")
    if blend.exists() and not options.overwrite:
        raise UserError(f"{blend} exists; name another file or pass --overwrite")
    _check_numbers(options)
    solved = load_solve(options.work)
    scene, settings, footage = _scene(solved)
    if any((options.focus_at, options.focus_point, options.focus_distance is not None)):
        _set_lens(settings, solved, options)
    blend.parent.mkdir(parents=True, exist_ok=True)
    settings.footage = str(_beside(footage, blend.parent))
    # The solve is in the .blend; another machine does not have this folder.
    settings.work_dir = ""
    if footage.is_video and scene.sequence_editor is not None:
        for strip in scene.sequence_editor.strips:
            strip.sound.filepath = settings.footage
    settings.camera.data.background_images[0].image.filepath = str(
        settings.footage if footage.is_video else Path(settings.footage).parent / footage.files[0].name
    )
    scene.render.filepath = "//render/"
    part = blend.with_name(f".part-{blend.name}")
    try:
        # Saved once where it will lie, because relative paths need to know.
        bpy.ops.wm.save_as_mainfile(
            filepath=str(blend.with_name(f".part-{blend.name}")), check_existing=False
        )
        make_paths_relative(settings)
        bpy.ops.file.make_paths_relative()
        bpy.ops.wm.save_as_mainfile(filepath=str(part), check_existing=False)
        part.replace(blend)
    finally:
        part.unlink(missing_ok=True)
        part.with_name(part.name + "1").unlink(missing_ok=True)
    _say(f"saved {blend}; send it together with {Path(bpy.path.abspath(settings.footage)).name} beside it")


def _beside(footage: Footage, folder: Path) -> Path:
    """The clip, copied beside the .blend unless it lies in that folder or below."""
    if footage.path.resolve().is_relative_to(folder.resolve()):
        return footage.path
    if footage.is_video:
        copies = {folder / footage.path.name: footage.path}
        path = folder / footage.path.name
    else:
        home = folder / f"{footage.files[0].parent.name}_frames"
        copies = {home / file.name: file for file in footage.files}
        path = home if footage.path.is_dir() else home / footage.path.name
    for target, source in copies.items():
        if target.exists():
            if target.stat().st_size != source.stat().st_size:
                raise UserError(
                    f"{target} exists and is another file than {source}; save into another folder"
                )
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        part = target.with_name(f".part-{target.name}")
        shutil.copyfile(source, part)
        part.replace(target)
    return path


def _render(solved: Solve, options: argparse.Namespace) -> None:
    scene, settings, footage = _scene(solved)
    _set_lens(settings, solved, options)
    wanted = FrameRange.parse(options.frames).of(footage.frames) if options.frames else footage.frames
    if not wanted:
        raise UserError(
            f"the solve has no frames {options.frames}; it has {footage.frames[0]} to {footage.frames[-1]}"
        )
    out: Path = options.out.absolute()
    is_movie = out.suffix.lower() in output.MOVIES
    # A movie shows every frame of the range: those that a step left out get their camera from neighbours.
    shown = open_footage(solved.footage, FrameRange(wanted[0], wanted[-1])).frames if is_movie else wanted
    frames = list(shown)
    least, most = output.plan_all(scene, frames)
    count = str(least) if least == most else f"{least} to {most}"
    _say(f"rendering {len(frames)} frames with {count} views each")
    carried = [f for f in frames if f not in solved.reconstruction.frames]
    if carried:
        _say(f"{len(carried)} frames are not registered; neighbours lend their cameras: {ranges(carried)}")
    # Started here, because Blender starts it noisily itself when the engine asks for a context.
    problem = gpu_problem()
    if problem:
        _say(no_gpu_note(problem))
    with contextlib.nullcontext(1) if options.debug else quiet(1) as descriptor:

        def report(text: str) -> None:
            os.write(descriptor, f"{text}\n".encode())

        if is_movie:
            output.render_movie(scene, frames, out, report)
        else:
            output.render_sequence(scene, frames, out, options.overwrite, report)
    _say(f"wrote {options.out}")


def _scene(solved: Solve) -> tuple[bpy.types.Scene, VirtualApertureSettings, Footage]:
    """A fresh scene that holds the solve."""
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    footage = open_footage(solved.footage, solved.frames)
    settings = build(scene, footage, solved.reconstruction)
    settings.work_dir = str(solved.work_dir)
    return scene, settings, footage


def _check_numbers(options: argparse.Namespace) -> None:
    """What can be refused before an hour of solving."""
    _views(options.views)
    for name, value in (("blur", options.blur), ("aperture radius", options.aperture_radius)):
        if value is not None and not value > 0:
            raise UserError(f"the {name} is {value:g}; it must be greater than zero")
    if options.focus_distance is not None and not options.focus_distance > 0:
        raise UserError(f"the focus distance is {options.focus_distance:g}; it must be greater than zero")
    if options.focus_at:
        x, y, _ = _place(options.focus_at)
        if not (0 <= x <= 1 and 0 <= y <= 1):
            raise UserError(f"focus at {x:g},{y:g} is outside the picture; both must be between 0 and 1")


def _set_lens(settings: VirtualApertureSettings, solved: Solve, options: argparse.Namespace) -> None:
    reconstruction = solved.reconstruction
    frame = int(reconstruction.frames[0])
    if options.focus_at:
        x, y, wanted = _place(options.focus_at)
        frame = frame if wanted is None else wanted
        focus = pick(reconstruction, frame, x, y)
        _say(f"in focus: points {', '.join(map(str, focus.points))} at frame {frame}")
    elif options.focus_point:
        focus = Focus(points=tuple(options.focus_point))
        check_points(reconstruction, focus.points)
    else:
        focus = Focus(distance=options.focus_distance)
    if options.method == "thesis" and len(focus.points) < 2:
        raise UserError(
            "the thesis's method needs at least two focus points: use --focus-at or --focus-point"
        )
    radius = options.aperture_radius
    if radius is None:
        radius = radius_for_blur(reconstruction, focus, frame, options.blur or DEFAULT_BLUR)
    check_settings(LensSettings(focus, radius, _views(options.views), options.method, options.seed))
    set_focus(settings, focus, frame)
    if options.depth:
        maps = open_depth(options.depth.absolute(), open_footage(solved.footage, solved.frames))
        for note in maps.notes:
            _say(f"note: {note}")
        settings.depth_maps = str(options.depth.absolute())
    if options.mask:
        masks = open_masks(options.mask.absolute(), open_footage(solved.footage, solved.frames))
        for note in masks.notes:
            _say(f"note: {note}")
        settings.masks = str(options.mask.absolute())
    settings.use_radius = options.aperture_radius is not None
    settings.aperture_radius = radius
    settings.blur = options.blur or DEFAULT_BLUR
    settings.views = _views(options.views)
    settings.method = options.method
    settings.borrow = options.borrow == "on"
    settings.seed = options.seed
    aperture_cloud.update(settings)


def _views(text: str) -> int:
    if text == "auto":
        return 0
    if not text.lstrip("-").isdigit():
        raise UserError(f"the number of views {text!r} is not understood; give a whole number or auto")
    if int(text) < 1:
        raise UserError(f"the number of views is {text}; it must be at least 1, or auto")
    return int(text)


def _place(text: str) -> tuple[float, float, int | None]:
    """From "X,Y" or "X,Y@FRAME"."""
    place, _, frame = text.partition("@")
    try:
        x, y = (float(part) for part in place.split(","))
        return x, y, int(frame) if frame else None
    except ValueError:
        raise UserError(
            f"the focus {text!r} is not understood; write X,Y or X,Y@FRAME, such as 0.5,0.6@12"
        ) from None


def _say(text: str) -> None:
    print(text, flush=True)


def run_command(arguments: list[str]) -> int:
    """Run one command: 0, or non-zero after one readable line on standard error."""
    options = parser().parse_args(arguments)
    try:
        options.command(options)
    except UserError as error:
        if options.debug:
            raise
        print(f"error: {error}", file=sys.stderr, flush=True)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; finished frames are kept", file=sys.stderr, flush=True)
        return 130
    except Exception as error:  # one readable line for everybody, the traceback for those who ask
        if options.debug:
            raise
        print(f"error: {type(error).__name__}: {error} (--debug shows where)", file=sys.stderr, flush=True)
        return 1
    return 0
