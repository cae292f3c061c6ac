"""The commands of the command line."""

import argparse
import contextlib
import signal
import traceback
from collections.abc import Callable, Sequence
from itertools import chain
from pathlib import Path
from types import FrameType

import bpy

from ..core.base import memory, streams
from ..core.base.atomic import collect_temporary, temporary_folder
from ..core.base.counting import counted, ranges
from ..core.base.errors import UserError, Words
from ..core.base.messages import Failure, Progress, Result, Warned, send
from ..core.base.streams import say, say_to
from ..core.base.worker import Worker, end_all
from ..core.media.clip import Footage, FrameRange, describe
from ..core.sfm.state import STATE
from ..core.sfm.workspace import Solve, default_work_dir, load_solve
from ..render import engine
from ..render.output import movie_file, movie_folder, output
from ..render.output.frame_files import run_key
from ..render.output.run_report import RunReport, check_report
from ..render.processes import jobs, launcher
from ..render.processes.launcher import JOB, write_blend
from ..render.views.gpu_views import check_gpu
from ..render.views.quiet import quiet
from ..scene import clip_properties, lens_properties, properties
from ..scene.base.paths import absolute
from ..scene.ignored import unseen
from ..scene.sources.shot import shot_of
from . import depth, export, farm, inspect, pick, save, solve
from .blend import is_blend, open_blend
from .engine_jobs import read_job
from .lens import all_frames, lacking, movie_frames, say_lens, scene_of, set_lens, wanted_frames
from .lens_options import add_lens, add_work, check_lens, check_numbers
from .options import SOLVED_WORDS, WORDS, Parser, UsageError, path
from .processes import add_jobs, sharing

CALLBACKS = {each.__file__ for each in (properties, clip_properties, lens_properties)}
"""Files of the callbacks of properties."""


def parser() -> argparse.ArgumentParser:
    """Return all commands; each sets `command` to the function that runs it."""
    top: argparse.ArgumentParser = Parser(
        prog="headless.py", description="Depth of field for all-sharp video."
    )
    top.set_defaults(words=WORDS)
    common = Parser(add_help=False)
    common.add_argument("--debug", action="store_true", help="show a traceback with errors")
    # Arguments that only a parent process has.
    common.set_defaults(child=False, scene="", scripts=False, as_is=False)
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    solve.add_commands(commands, common)
    pick.add_command(commands, common)
    depth.add_command(commands, common)
    two = commands.add_parser("render", parents=[common], help="render a solved clip with depth of field")
    add_work(two)
    add_lens(two, required=False)
    _add_frames(two, "frames to render")
    two.add_argument(
        "--for-movie",
        action="store_true",
        help="render frames for join: every frame of the range, in even sizes",
    )
    _add_output(two)
    two.set_defaults(command=render)
    three = commands.add_parser("run", parents=[common], help="solve and render")
    solve.add_footage(three)
    three.add_argument("--work", type=path, metavar="DIR", help="default: CLIP.aperture next to the output")
    _add_frames(three, "frames to render; the whole clip is solved")
    solve.add_solve_frames(three)
    add_lens(three, required=True)
    _add_output(three)
    three.set_defaults(command=run, words=SOLVED_WORDS, for_movie=False)
    save.add_command(commands, common)
    export.add_command(commands, common)
    farm.add_commands(commands, common)
    inspect.add_command(commands, common)
    return top


def _add_frames(command: argparse.ArgumentParser, description: str) -> None:
    which = command.add_mutually_exclusive_group()
    which.add_argument("--frames", type=FrameRange.parse, metavar="A-B[:STEP]", help=description)
    which.add_argument("--still", metavar="NAME", help="the photo to render, by its file name")


def _add_output(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--out", type=path, required=True, metavar="FILE.mp4|DIR/####.png|DIR/####.exr",
        help="with --still FILE.png or FILE.exr, too",
    )  # fmt: skip
    command.add_argument("--overwrite", action="store_true", help="replace existing output")
    add_jobs(command)
    command.add_argument(
        "--report",
        type=path,
        metavar="FILE.json",
        help="write the method, mesh, error, sources and time of each frame",
    )


def _check_output(options: argparse.Namespace) -> None:
    output.check_output(options.out.absolute(), options.overwrite, options.still is not None)
    if not options.child:
        movie_folder.check_not_kept(options.out.absolute().parent)
    if options.report:
        check_report(options.report, options.overwrite)
        output.check_folder(options.report.absolute().parent)


def _check_apart(options: argparse.Namespace, *sources: Path | None) -> None:
    """UserError for output that would replace, or lie among, what it is made from."""
    out = options.out.absolute()
    written = [out, movie_folder.folder_of(out)] if out.suffix.lower() in movie_file.MOVIES else [out.parent]
    output.check_apart([*written, *([options.report] if options.report else [])], filter(None, sources))


def render(options: argparse.Namespace) -> None:
    """Run `render DIR ... --out OUT` or `render FILE.blend --out OUT`."""
    _check_output(options)
    check_lens(options, required=True)
    with output.claimed(options.out.absolute()):
        _check_output(options)
        _render(None if is_blend(options.work) else load_solve(options.work), options)


def run(options: argparse.Namespace) -> None:
    """Run `run FOOTAGE ... --out OUT`."""
    _check_output(options)
    check_numbers(options)
    _check_apart(options, options.footage, options.mask, options.depth)
    work = options.work or default_work_dir(options.footage, options.out.absolute().parent)
    if options.report and options.report.absolute() == work.absolute() / STATE:
        raise UserError(f"{options.report} is where the solve will be kept; choose another file")

    def check(clip: Footage) -> None:
        movie_file.check_rate(options.out, clip, wanted_frames(clip, _frames(options, clip)))

    with output.claimed(options.out.absolute()):
        _check_output(options)
        solved = solve.solve_clip(options, work, check, options.depth)
        solve.say_quality(solved, options.words)
        _render(solved, options)


def _frames(options: argparse.Namespace, footage: Footage) -> FrameRange | None:
    """The frames that the options ask for, by number or by name."""
    if options.still is None:
        frames: FrameRange | None = options.frames
        return frames
    frame = footage.named(options.still)
    return FrameRange(frame, frame)


def _render(solved: Solve | None, options: argparse.Namespace) -> None:
    """Render the solve with the lens of the options, or else the .blend."""
    send(Progress("Opening the clip", 0, 0))
    if solved is None:
        scene, settings, footage = open_blend(options.work, options.scene, options.scripts, options.as_is)
    else:
        scene, settings, footage = scene_of(solved)
    pictures = (settings.depth_maps, settings.masks) if solved is None else (options.depth, options.mask)
    _check_apart(options, footage.path, *(absolute(str(path)) for path in pictures if path))
    _check_interrupted()
    for note in (*footage.notes, *unseen(scene)):
        say(f"note: {note}")
    out: Path = options.out.absolute()
    options.frames = _frames(options, footage)
    if options.still is not None:
        # Photos have a size each.
        scene.render.resolution_x, scene.render.resolution_y = shot_of(scene).size(options.frames.first)
    is_movie = out.suffix.lower() in movie_file.MOVIES
    if options.for_movie:
        # A share of those that a movie shows.
        frames = all_frames(footage, options.frames)
        output.crop_to_even(scene.render)
    elif is_movie:
        frames = movie_frames(footage, options.frames)
        movie_file.check_rate(out, scene, frames)
    else:
        frames = list(wanted_frames(footage, options.frames))
    if solved is not None:
        if options.grain is None and out.suffix.lower() == ".exr" and not options.for_movie:
            # Compositing adds grain last.
            options.grain = 0.0
        # A share of a farm's job focuses as the whole does.
        set_lens(settings, solved, options, () if options.for_movie else frames)
    if absent := ([] if options.for_movie else lacking(footage, options.frames)):
        say(f"note: the clip has {describe(footage.frames)}; not rendered: {', '.join(absent)}")
    reconstruction = shot_of(scene).reconstruction
    say_lens(settings, reconstruction, frames)
    planned = output.plan_all(scene, frames)
    least, most = planned.views
    count = str(least) if least == most else f"{least} to {most}"
    taken = f"{count} {'view' if most == 1 else 'views'} each"
    say(f"rendering {counted(len(frames), 'frame')} with {taken}")
    if planned.coarse:
        say(
            f"blur discs are too large for layers in {counted(len(planned.coarse), 'frame')}"
            f" ({ranges(planned.coarse)}), which are drawn with features, one coarse mesh, instead; a"
            f" smaller blur or aperture keeps layers"
        )
    unregistered = [f for f in frames if f not in reconstruction.frames]
    if unregistered:
        missing = f"{counted(len(unregistered), 'frame')} not registered"
        say(f"{missing}; their cameras are interpolated: {ranges(unregistered)}")
    run_report = _draw(scene, frames, options)
    if repaired := shot_of(scene).clip.repaired:
        text = (
            f"{sum(repaired.values())} pixels of {len(repaired)} frames were not finite (NaN or infinite)"
            f" and were filled in: {ranges(sorted(repaired))}"
        )
        say(text)
        send(Warned(text))
    if summary := run_report.summary(frames):
        say(summary)
    if unknown := run_report.lacks(frames):
        say(f"no report for existing frames: {ranges(unknown)}")
    say(f"wrote {options.out}")


def _draw(scene: bpy.types.Scene, frames: list[int], options: argparse.Namespace) -> RunReport:
    """Render frames into the output, in as many processes as fit; returns their report."""
    out: Path = options.out.absolute()
    silent = contextlib.nullcontext(1) if options.debug else quiet(1)
    with sharing(options, len(frames), shot_of(scene)) as count:
        # Started here, because Blender starts it noisily itself when the engine asks for a context.
        check_gpu()
        run_report = RunReport(
            options.report.absolute() if options.report else None, run_key(scene), options.overwrite
        )
        waits = True

        def report(text: str) -> None:
            nonlocal waits
            waits = False
            say_to(descriptor, text)
            _check_interrupted()

        def on_progress(stage: str, share: float) -> None:
            if waits:
                send(Progress(f"{stage} {100 * share:.0f}%, first frame", 0, len(frames)))

        with silent as descriptor, engine.watched(run_report.on_frame, on_progress):
            draw = None if count == 1 else _side_by_side(scene, options, count, run_report, report)
            if out.suffix.lower() in movie_file.MOVIES:
                output.render_movie(scene, frames, out, report, draw)
            else:
                output.render_sequence(scene, frames, out, options.overwrite, report, draw)
    # How others drew their frames is known from their reports alone.
    return run_report if count == 1 or options.report else RunReport()


def _side_by_side(
    scene: bpy.types.Scene,
    options: argparse.Namespace,
    count: int,
    run_report: RunReport,
    report: output.Note,
) -> output.Draw:
    """Have frames drawn by `count` processes of this command line, which get the scene as a .blend."""
    is_movie = options.for_movie or options.out.suffix.lower() in movie_file.MOVIES
    step = options.frames.step if options.frames and not is_movie else 1

    def draw(todo: list[int], out: Path, here: jobs.Here, done: Callable[[int], None]) -> None:
        with temporary_folder() as scratch:
            blend = scratch / "scene.blend"
            write_blend(blend)
            reports = [scratch / f"report-{number}.json" for number in range(count)]

            def start(worker: Worker, frames: Sequence[int], number: int) -> None:
                words = ["render", blend, "--jobs", 1, "--out", out]
                words += ["--frames", f"{frames[0]}-{frames[-1]}:{step}"]
                words += ["--for-movie"] * is_movie + ["--overwrite"] * (is_movie or options.overwrite)
                words += ["--report", reports[number]] if options.report else []
                launcher.start(worker, words, scene.name, one_thread=True, as_is=options.as_is)

            try:
                jobs.render_side_by_side(todo, count, start, here, done, report)
            finally:
                for path in reports:
                    run_report.take_over(path)

    return draw


class _Interrupted(KeyboardInterrupt):
    """Ctrl-C, SIGTERM, which farms send before they kill, or SIGHUP of a closed terminal."""


_signal = 0
"""Number of the signal that was heard. Blender loses exceptions where it calls Python from within."""


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _signal
    _signal = number
    if not _is_called_by_blender(frame):
        raise _Interrupted


def _ending() -> list[signal.Signals]:
    """The signals that end a command. Not SIGHUP where it is ignored, as `nohup` has it."""
    names = ("SIGINT", "SIGTERM", "SIGHUP")
    found = [signal.Signals[name] for name in names if name in signal.Signals.__members__]
    return [
        each for each in found
        if each.name != "SIGHUP" or signal.getsignal(each) is not signal.SIG_IGN
    ]  # fmt: skip


def _is_called_by_blender(frame: FrameType | None) -> bool:
    """Whether code runs whose exceptions Blender only prints: its own scripts, callbacks and handlers."""
    scripts = bpy.utils.system_resource("SCRIPTS")
    if frame is None or (scripts and frame.f_code.co_filename.startswith(scripts)):
        return True
    lists = (getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers))
    handlers = chain.from_iterable(each for each in lists if isinstance(each, list))
    # Not all that stands in their files: loops do that are to end.
    called = {getattr(handler, "__code__", None) for handler in handlers}
    return any(
        caller.f_code in called or caller.f_code.co_filename in CALLBACKS
        for caller, _ in traceback.walk_stack(frame)
    )


def _check_interrupted() -> None:
    if _signal:
        raise _Interrupted


def run_command(arguments: list[str]) -> int:
    """Run one command: 0, or non-zero after one readable line on standard error."""
    global _signal
    _signal, debug, words = 0, "--debug" in arguments, WORDS
    streams.open_all()
    # Blender's program has another handler for Ctrl-C, which only ends the present frame.
    before = {number: signal.signal(number, _interrupt) for number in _ending()}
    try:
        collect_temporary()
        is_job = arguments == [JOB]
        options = read_job(parser()) if is_job else parser().parse_args(arguments)
        words = options.words
        options.command(options)
        _check_interrupted()
        streams.check()
        send(Result())
    except SystemExit:
        # argparse's way to end after --help.
        streams.flush()
    except (Exception, KeyboardInterrupt) as error:
        if debug and not _signal:
            raise
        text = _message(error, words)
        status = 128 + _signal if _signal else 2 if isinstance(error, UsageError) else 1
        if isinstance(error, UserError) and not _signal:
            # The parent has other words for the remedies.
            send(Failure(str(error), error.remedies))
        else:
            send(Failure(text))
        streams.complain(text)
        return status
    finally:
        # The command line leaves without Python's own steps at exit.
        end_all()
        # A process that had to be killed leaves its files; where no file can be written, there are none.
        with contextlib.suppress(UserError):
            collect_temporary()
        for number, handler in before.items():
            if handler is not None:  # one of Blender's own cannot be put back
                signal.signal(number, handler)
    return 0


def _message(error: BaseException, words: Words) -> str:
    """One readable line; `--debug` shows the traceback."""
    if _signal:
        return "interrupted; finished frames are kept"
    if isinstance(error, UserError):
        return error.worded(words)
    if memory.is_shortage(error):
        return str(memory.shortage("the command could not be finished"))
    return f"{type(error).__name__}: {error} (--debug shows where)"
