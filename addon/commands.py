"""The commands of the command line."""

from __future__ import annotations

import argparse
import contextlib
import os
import shutil
import signal
import sys
from pathlib import Path

import bpy

from . import commands_inspect, commands_solve
from .commands_lens import add_lens, check_numbers, say, scene_of, set_lens
from .commands_words import WORDS
from .core.counting import counted
from .core.errors import UserError
from .core.footage import Footage, FrameRange, open_footage
from .core.solve_folder import Solve, default_work_dir, load_solve
from .core.solve_report import ranges
from .render import engine, output
from .render.account import Account, check_report
from .render.average import no_gpu_note
from .render.frame_keys import run_key
from .render.gpu_views import gpu_problem
from .render.quiet import quiet
from .scene.build import move_clip
from .scene.shot import shot_of


def parser() -> argparse.ArgumentParser:
    """All commands; each sets `command` to the function that runs it."""
    top = argparse.ArgumentParser(prog="headless.py", description="Depth of field for all-sharp video.")
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show a traceback with errors")
    commands = top.add_subparsers(required=True, metavar="COMMAND")

    commands_solve.add_commands(commands, common)
    two = commands.add_parser("render", parents=[common], help="render a solved clip with depth of field")
    two.add_argument("work", type=Path, metavar="DIR", help="folder that keeps the solve")
    add_lens(two, required=True)
    two.add_argument("--frames", metavar="A-B[:STEP]", help="frames to render")
    _add_output(two)
    two.set_defaults(command=render)

    three = commands.add_parser("run", parents=[common], help="solve and render")
    commands_solve.add_footage(three)
    three.add_argument("--work", type=Path, metavar="DIR", help="default: CLIP.aperture beside the output")
    three.add_argument("--frames", metavar="A-B[:STEP]", help="frames of the clip to solve and render")
    add_lens(three, required=True)
    _add_output(three)
    three.set_defaults(command=run)

    four = commands.add_parser(
        "save", parents=[common], help="save the solved clip as a .blend, ready to open or to send"
    )
    four.add_argument("work", type=Path, metavar="DIR", help="folder that keeps the solve")
    four.add_argument("--blend", type=Path, required=True, metavar="FILE")
    four.add_argument("--overwrite", action="store_true", help="replace the .blend if it exists")
    add_lens(four, required=False)
    four.set_defaults(command=save)

    commands_inspect.add_command(commands, common)
    return top


def _add_output(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE.mp4|DIR/####.png|DIR/####.exr")
    command.add_argument("--overwrite", action="store_true", help="replace output that exists")
    command.add_argument(
        "--report", type=Path, metavar="FILE.json", help="method, mesh, error, sources and time of each frame"
    )


def _check_output(options: argparse.Namespace) -> None:
    output.check_output(options.out, options.overwrite)
    if options.report:
        check_report(options.report, options.overwrite)
        output.check_folder(options.report.absolute().parent)


def render(options: argparse.Namespace) -> None:
    """`render DIR ... --out OUT`"""
    _check_output(options)
    check_numbers(options)
    _render(load_solve(options.work), options)


def run(options: argparse.Namespace) -> None:
    """`run FOOTAGE ... --out OUT`"""
    _check_output(options)
    check_numbers(options)
    solved = commands_solve.solve_clip(
        options, options.work or default_work_dir(options.footage, options.out.absolute().parent)
    )
    say(solved.summary)
    _render(solved, options)


def save(options: argparse.Namespace) -> None:
    """`save DIR --blend FILE`: the .blend, and the clip beside it, so that the folder is all there is."""
    blend: Path = options.blend.absolute()
    if blend.suffix.lower() != ".blend":
        raise UserError(f"{blend.name} must end in .blend")
    if blend.exists() and not options.overwrite:
        raise UserError(f"{blend} exists; name another file or pass --overwrite")
    check_numbers(options)
    solved = load_solve(options.work)
    scene, settings, footage = scene_of(solved)
    if any((options.focus_at, options.focus_point, options.focus_distance is not None)):
        set_lens(settings, solved, options)
    blend.parent.mkdir(parents=True, exist_ok=True)
    clip = _beside(footage, blend.parent)
    move_clip(scene, open_footage(clip, footage.frames))
    # The solve is in the .blend; another machine does not have this folder.
    settings.work_dir = ""
    scene.render.filepath = "//render/"
    part = blend.with_name(f".part-{blend.name}")
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(part), check_existing=False)
        part.replace(blend)
    finally:
        part.unlink(missing_ok=True)
        part.with_name(part.name + "1").unlink(missing_ok=True)
    say(f"saved {blend}; send it together with {clip.name} beside it")


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
    scene, settings, footage = scene_of(solved)
    wanted = FrameRange.parse(options.frames).of(footage.frames) if options.frames else footage.frames
    if not wanted:
        raise UserError(
            f"the solve has no frames {options.frames}; it has {footage.frames[0]} to {footage.frames[-1]}"
        )
    set_lens(settings, solved, options, wanted)
    out: Path = options.out.absolute()
    is_movie = out.suffix.lower() in output.MOVIES
    # A movie shows every frame of the range: those that a step left out get their camera from neighbours.
    shown = open_footage(solved.footage, FrameRange(wanted[0], wanted[-1])).frames if is_movie else wanted
    frames = list(shown)
    least, most = output.plan_all(scene, frames)
    count = str(least) if least == most else f"{least} to {most}"
    say(f"rendering {counted(len(frames), 'frame')} with {count} {'view' if most == 1 else 'views'} each")
    carried = [f for f in frames if f not in solved.reconstruction.frames]
    if carried:
        missing = f"{counted(len(carried), 'frame')} not registered"
        say(f"{missing}; neighbours lend their cameras: {ranges(carried)}")
    # Started here, because Blender starts it noisily itself when the engine asks for a context.
    problem = gpu_problem()
    if problem:
        say(no_gpu_note(problem))
    account = Account(
        options.report.absolute() if options.report else None, run_key(scene), options.overwrite
    )
    silent = contextlib.nullcontext(1) if options.debug else quiet(1)
    with silent as descriptor, engine.telling(account.told):

        def report(text: str) -> None:
            os.write(descriptor, f"{text}\n".encode())

        if is_movie:
            output.render_movie(scene, frames, out, report)
        else:
            output.render_sequence(scene, frames, out, options.overwrite, report)
    if repaired := shot_of(scene).repaired:
        say(
            f"{sum(repaired.values())} pixels of {len(repaired)} frames were not finite (NaN or infinite) and"
            f" were filled from around: {ranges(sorted(repaired))}"
        )
    if told := account.summary(frames):
        say(told)
    if lacking := account.lacks(frames):
        say(f"no report of frames that were there already: {ranges(lacking)}")
    say(f"wrote {options.out}")


class _Terminated(KeyboardInterrupt):
    """Whoever runs the command wants it to end, as farms do before they kill."""


def _terminate(_number: int, _frame: object) -> None:
    raise _Terminated


def run_command(arguments: list[str]) -> int:
    """Run one command: 0, or non-zero after one readable line on standard error."""
    options = parser().parse_args(arguments)
    # Blender's program has a handler of its own for Ctrl-C, which only ends the frame under way.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, _terminate)
    try:
        options.command(options)
    except UserError as error:
        if options.debug:
            raise
        print(f"error: {error.told(WORDS)}", file=sys.stderr, flush=True)
        return 1
    except KeyboardInterrupt as error:
        print("error: interrupted; finished frames are kept", file=sys.stderr, flush=True)
        return 128 + (signal.SIGTERM if isinstance(error, _Terminated) else signal.SIGINT)
    except Exception as error:  # one readable line for everybody, the traceback for those who ask
        if options.debug:
            raise
        print(f"error: {type(error).__name__}: {error} (--debug shows where)", file=sys.stderr, flush=True)
        return 1
    return 0
