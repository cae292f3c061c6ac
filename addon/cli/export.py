"""The command that exports a solved clip for other programs."""

import argparse
import contextlib
from pathlib import Path

from ..core.base.atomic import staged_folder
from ..core.base.counting import counted
from ..core.base.errors import UserError
from ..core.base.streams import say, say_to
from ..core.media.clip import FrameRange
from ..core.readers.colmap_export import write_model
from ..core.sfm.workspace import load_solve
from ..render.output import export as exports
from ..render.output.output import check_apart
from ..render.views.quiet import quiet
from ..scene.base.paths import absolute
from ..scene.sources.shot import shot_of
from .blend import is_blend, open_blend
from .lens import say_lens, scene_of, set_lens, wanted_frames
from .lens_options import add_lens, add_work, check_lens, given_lens
from .options import Commands, UsageError, path


def add_command(commands: Commands, common: argparse.ArgumentParser) -> None:
    """Add the command `export`, which sets `command` to the function that runs it."""
    one = commands.add_parser(
        "export", parents=[common], help="export frames in two layers, STMaps, or the solve for COLMAP"
    )
    add_work(one)
    kind = one.add_mutually_exclusive_group(required=True)
    meanings = "; ".join(f"{name}: {words}" for name, (_, words) in exports.WHAT.items())
    kind.add_argument("--what", choices=list(exports.WHAT), help=meanings)
    kind.add_argument("--model", type=path, metavar="OUT", help="new folder for a COLMAP text model")
    one.add_argument("--out", type=path, metavar="DIR", help="folder for the files of --what")
    one.add_argument("--frames", type=FrameRange.parse, metavar="A-B[:STEP]", help="frames to export (all)")
    one.add_argument("--overwrite", action="store_true", help="replace existing files")
    add_lens(one, required=False)
    one.set_defaults(command=export)


def export(options: argparse.Namespace) -> None:
    """Run `export DIR|FILE.blend --what WHAT --out OUT`, or `export DIR --model OUT`."""
    if options.model is not None:
        if options.out is not None or options.frames is not None or given_lens(options):
            raise UsageError("--model exports the whole solve and takes no other options; see --help")
        _export_model(options)
        return
    if options.out is None:
        raise UsageError("--what needs --out, a folder for the files; see --help")
    check_lens(options, required=options.what == exports.LAYERS)
    if is_blend(options.work):
        scene, settings, footage = open_blend(options.work, options.scene, options.scripts)
        pictures = [absolute(text) for text in (settings.depth_maps, settings.masks) if text]
    else:
        solved = load_solve(options.work)
        scene, settings, footage = scene_of(solved)
        pictures = [each for each in (options.depth, options.mask) if each is not None]
    out: Path = options.out.absolute()
    check_apart([out], [footage.path, *pictures])
    frames = wanted_frames(footage, options.frames)
    if options.what == exports.LAYERS:
        if not is_blend(options.work):
            set_lens(settings, solved, options, frames)
        say_lens(settings, shot_of(scene).reconstruction, frames)
    files = exports.planned(scene, options.what, frames, out)
    exports.check_free(files, options.overwrite)
    silent = contextlib.nullcontext(1) if options.debug else quiet(1)
    with silent as descriptor:
        exports.write(files, lambda text: say_to(descriptor, text))
    say(f"wrote {counted(len(files), 'file')} into {options.out}")


def _export_model(options: argparse.Namespace) -> None:
    """A solve as a COLMAP text model, in a new folder."""
    solved = load_solve(options.work.absolute())
    out: Path = options.model.absolute()
    if out.exists():
        raise UserError(f"{out} exists; name a new folder")
    footage = solved.open_clip(solved.frames)
    names = {} if footage.is_video else {frame: footage.file(frame).name for frame in footage.frames}
    try:
        with staged_folder(out) as part:
            write_model(part, solved.reconstruction, names)
    except OSError as error:
        raise UserError(f"{out} cannot be written: {error.strerror}") from error
    if any(solved.reconstruction.readout):
        say("COLMAP knows no rolling shutter: poses are those of the picture's middle")
    say(f"wrote {options.model}: {solved.summary}")
