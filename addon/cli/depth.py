"""Depth of a clip, found ahead of renders and kept beside its solve."""

import argparse
from collections.abc import Callable, Sequence

import bpy

from ..core.base.atomic import temporary_folder
from ..core.base.counting import counted, ranges
from ..core.base.errors import UserError
from ..core.base.messages import Warned, send
from ..core.base.streams import say
from ..core.base.time_left import Clock
from ..core.base.worker import Worker
from ..core.media.clip import FrameRange
from ..core.sfm.workspace import Solve, load_solve
from ..core.subjects.steadiness import jumps
from ..render.processes import jobs, launcher
from ..render.views.gpu_views import start_gpu
from ..scene.sources.shot import Shot, shot_of
from .blend import is_blend, open_blend
from .lens import scene_of, set_moving, wanted_frames
from .lens_options import add_moving, add_work
from .options import Commands, UsageError
from .processes import add_jobs, sharing


def add_command(commands: Commands, common: argparse.ArgumentParser) -> None:
    """Add the command `depth DIR`."""
    command = commands.add_parser(
        "depth", parents=[common], help="find the depth of frames ahead of rendering"
    )
    add_work(command)
    command.add_argument(
        "--frames", type=FrameRange.parse, metavar="A-B[:STEP]", help="frames to find depth for (all)"
    )
    add_moving(command)
    add_jobs(command)
    command.set_defaults(command=depth)


def depth(options: argparse.Namespace) -> None:
    """Run `depth DIR` or `depth FILE.blend`."""
    if is_blend(options.work):
        if options.mask or options.subject or options.colour_space or options.segmenter:
            raise UsageError(f"{options.work.name} has masks, strokes, networks and a color space of its own")
        scene, _, footage = open_blend(options.work)
        problem = keep_depth(scene, wanted_frames(footage, options.frames), options)
    else:
        problem = depth_of_solve(load_solve(options.work.absolute()), options)
    if problem:
        raise problem


FEWEST_JUMPS = 3
"""Least jumps of moving objects that are reported: one may come into view and leave. Chosen by inspection."""
WORDED = " (--subject X,Y)"
"""Name of this remedy in the interface."""
NOTHING = {
    "mask": None,
    "subject": None,
    "colour_space": None,
    "jobs": None,
    "child": False,
}
"""Options that `solve --depth` does not have."""


def depth_of_solve(solved: Solve, options: argparse.Namespace) -> UserError | None:
    """Call `keep_depth` of a solve, with the options' moving objects."""
    scene, settings, footage = scene_of(solved)
    set_moving(settings, solved, options)
    return keep_depth(scene, wanted_frames(footage, options.frames), options)


def keep_depth(
    scene: bpy.types.Scene, frames: Sequence[int], options: argparse.Namespace
) -> UserError | None:
    """Find the depth of frames of a scene's clip and keep it beside the solve: renders read it there.

    Ends at a frame whose depth cannot be kept, and returns what is kept and why that is not.
    """
    shot = shot_of(scene)
    if shot.reconstruction.stays:
        return UserError("there is no depth to find because the camera does not move; use depth maps")
    clock = Clock("depth", len(frames), say, "depth of frame {}")
    with sharing(options, len(frames), shot) as count:
        if count == 1:
            problem = _one_by_one(shot, frames, clock.tick)
        else:
            problem = _side_by_side(shot, frames, count, options, clock.tick)
    if problem is None:
        say(f"the depth of {counted(len(frames), 'frame')} is kept in {shot.work}")
        if not (options.child and options.jobs):
            _say_jumps(shot, frames)
        return None
    if options.child:
        # The parent counts the frames of all its processes.
        return problem
    there = sum(shot.context.stereo.kept(each) is not None for each in frames)
    kept = f"the depth of {there} of {counted(len(frames), 'frame')} is kept in {shot.work}"
    return UserError(f"{kept}; {problem}", *problem.remedies)


def _say_jumps(shot: Shot, frames: Sequence[int]) -> None:
    """Print the frames with jumps of moving pixels, if the user has marked nothing."""
    if shot.subjects or shot.masks or shot.drawn:
        return
    kept = (shot.context.stereo.kept(frame) for frame in frames)
    found = [frames[number] for number in jumps(depth.moving for depth in kept if depth is not None)]
    if len(found) < FEWEST_JUMPS:
        return
    where = f"{counted(len(found), 'frame')} ({ranges(found)})"
    text = f"moving subjects are uncertain in {where}, where they jump; mark them with a stroke"
    say(f"note: {text}{WORDED}")
    send(Warned(text))


def _one_by_one(shot: Shot, frames: Sequence[int], done: Callable[[int], None]) -> UserError | None:
    start_gpu()
    stereo = shot.context.stereo
    for frame in frames:
        stereo.at(frame)
        if stereo.kept(frame) is None:
            why = stereo.not_kept or UserError("what was written cannot be read back")
            return UserError(f"the depth of frame {frame} cannot be kept: {why}", *why.remedies)
        done(frame)
    return None


def _side_by_side(
    shot: Shot, frames: Sequence[int], count: int, options: argparse.Namespace, done: Callable[[int], None]
) -> UserError | None:
    step = options.frames.step if options.frames else 1
    with temporary_folder() as scratch:
        blend = scratch / "scene.blend"
        launcher.write_blend(blend)

        def start(worker: Worker, share: Sequence[int], _number: int) -> None:
            words = ["depth", blend, "--jobs", 1, "--frames", f"{share[0]}-{share[-1]}:{step}"]
            launcher.start(worker, words, one_thread=True)

        def here(share: Sequence[int], done: Callable[[int], None]) -> None:
            if problem := _one_by_one(shot, share, done):
                raise problem

        try:
            jobs.render_side_by_side(frames, count, start, here, done, say)
        except UserError as error:
            return error
    return None
