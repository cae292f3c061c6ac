"""The command that shows what a frame is drawn from."""

import argparse
import contextlib
import json
from dataclasses import replace
from pathlib import Path

import bpy

from ..core.base.arrays import Bytes
from ..core.base.atomic import write_bytes
from ..core.base.errors import UserError
from ..core.base.file_names import check_file
from ..core.base.streams import say
from ..core.frame.inspection import NAMES
from ..core.frame.report import FrameReport
from ..core.sfm.workspace import load_solve
from ..render.output import output
from ..render.output.run_report import Inspector, write_picture
from ..render.views.average import render_frame
from ..render.views.frame_size import render_size
from ..render.views.gpu_views import check_gpu
from ..render.views.quiet import quiet
from ..scene.base.timeline import go_to
from ..scene.lens.lens import frame_options
from ..scene.sources.shot import shot_of
from .lens import say_lens, scene_of, set_lens
from .lens_options import add_lens, check_numbers
from .options import Commands, path, whole

REPORT = "report.json"


def add_command(commands: Commands, common: argparse.ArgumentParser) -> None:
    """Add the command `inspect`, which sets `command` to the function that runs it."""
    one = commands.add_parser(
        "inspect", parents=[common], help="show what a frame is drawn from, as pictures and figures"
    )
    one.add_argument("work", type=path, metavar="DIR", help="folder of the solve")
    one.add_argument("--frame", type=whole(0), required=True, metavar="N", help="frame of the clip")
    one.add_argument("--out", type=path, required=True, metavar="DIR", help="folder for the pictures")
    one.add_argument("--overwrite", action="store_true", help="replace existing pictures")
    add_lens(one, required=True)
    one.set_defaults(command=inspect)


def inspect(options: argparse.Namespace) -> None:
    """Run `inspect DIR --frame N ... --out OUT`."""
    out: Path = options.out.absolute()
    files = [out / name for name in (*(f"{name}.png" for name in NAMES), REPORT)]
    for file in files:
        check_file(file)
    there = [file for file in files if file.exists()]
    if there and not options.overwrite:
        raise UserError(f"{there[0]} already exists; choose another folder or pass --overwrite")
    output.check_folder(out)
    check_numbers(options)
    solved = load_solve(options.work)
    scene, settings, footage = scene_of(solved)
    if options.frame not in footage.frames:
        raise UserError(
            f"the solve has no frame {options.frame}; it has {footage.frames[0]} to {footage.frames[-1]}"
        )
    sources = [source for source in (solved.footage, options.mask, options.depth) if source is not None]
    output.check_apart([out], sources)
    set_lens(settings, solved, options, (options.frame,))
    say_lens(settings, solved.reconstruction, (options.frame,))
    # A focus that is followed is another one at each frame.
    go_to(scene, options.frame)
    pictures, report = _inspected(scene, options.frame, options.debug)
    # Pictures that this frame lacks must not be left from another one.
    for file in there:
        file.unlink()
    for name, picture in pictures.items():
        write_picture(out / f"{name}.png", picture)
    write_bytes(out / REPORT, f"{json.dumps(report.as_dict(), indent=1)}\n".encode())
    for line in report.words():
        say(line)
    say(f"wrote {', '.join(pictures)} and {REPORT} into {options.out}")


def _inspected(scene: bpy.types.Scene, frame: int, debug: bool) -> tuple[dict[str, Bytes], FrameReport]:
    shot, inspector = shot_of(scene), Inspector()
    # The pictures are of the frame as the clip has it.
    lens = replace(frame_options(scene.virtual_aperture, shot.reconstruction), stabilize=0.0, sensor=0.0)
    size = render_size(scene.render)
    check_gpu()
    with contextlib.nullcontext(1) if debug else quiet(1):
        render_frame(shot.context, frame, lens, size, lambda note: None, inspector.on_frame)
    assert inspector.report is not None
    return inspector.pictures, inspector.report
