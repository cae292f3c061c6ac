"""The commands for farms: a job's bundle, and joining the frames that its machines rendered."""

import argparse
import contextlib
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy

from ..core.base import atomic
from ..core.base.counting import counted
from ..core.base.errors import UserError
from ..core.base.streams import say
from ..core.media.clip import FrameRange, open_footage
from ..core.media.copying import copy_clip, copy_file
from ..core.sfm.state import STATE, read_state, write_state
from ..core.sfm.workspace import load_solve
from ..render.output import movie_file, output
from ..render.output.frame_files import frame_keys
from ..render.processes.launcher import launcher, write_blend
from ..render.views.frame_size import written_size
from ..render.views.quiet import quiet
from ..scene.build import move_clip
from ..scene.sources.shot import reconstruction_of
from . import NAME
from .aperture import image_of, with_image
from .blend import is_blend, open_blend
from .farm_formats import FORMATS, TASK_FRAMES
from .lens import movie_frames, say_lens, scene_of, set_lens
from .lens_options import add_lens, add_work, check_lens, check_numbers, given_lens, has_focus, write_lens
from .options import SOLVED_WORDS, Commands, path, whole
from .save import copied, copy_beside
from .solve import add_footage, add_solve_frames, solve_arguments

VERSION = "jobtemplate-2023-09"
CHUNKS = 1024
"""The most values that Open Job Description lets a task parameter list."""
FRAMES = "frames/######.png"
BLEND, LENS, REPAIR = "scene.blend", "lens.json", "repair.json"
"""Files of the bundle: the scene, and until there is one the options and repairs of its lens."""


def add_commands(commands: Commands, common: argparse.ArgumentParser) -> None:
    """Add the commands `farm` and `join`; each sets `command` to the function that runs it."""
    one = commands.add_parser(
        "farm", parents=[common], help="write a render farm job for Open Job Description, Flamenco, Deadline"
    )
    one.description = "The job renders chunks of frames in parallel and joins them into a movie with sound."
    add_footage(one, "DIR|FOOTAGE", "folder of the solve, or a clip, which the job then solves first")
    one.add_argument("--out", type=path, required=True, metavar="BUNDLE", help="folder for the job")
    one.add_argument(
        "--format", choices=list(FORMATS), default=next(iter(FORMATS)), help="what reads the job (openjd)"
    )
    one.add_argument("--chunk", type=whole(1), default=12, metavar="N", help="frames per task (default 12)")
    one.add_argument("--frames", type=FrameRange.parse, metavar="A-B", help="frames to render")
    add_solve_frames(one)
    one.add_argument("--movie", default="movie.mp4", metavar="NAME", help="name of the movie (movie.mp4)")
    add_lens(one, required=True)
    one.set_defaults(command=farm, words=SOLVED_WORDS)
    two = commands.add_parser("join", parents=[common], help="join rendered frames into a movie with sound")
    two.description = (
        "Give the same focus and other settings as for render: frames made with others are refused."
    )
    add_work(two)
    two.add_argument(
        "--rendered",
        type=path,
        required=True,
        metavar="DIR/####.png",
        help="frames rendered with --for-movie",
    )
    two.add_argument("--out", type=path, required=True, metavar="FILE.mp4")
    two.add_argument("--frames", type=FrameRange.parse, metavar="A-B", help="frames of the movie")
    two.add_argument("--overwrite", action="store_true", help="replace the movie if it exists")
    add_lens(two, required=False)
    two.set_defaults(command=join)


def join(options: argparse.Namespace) -> None:
    """Run `join DIR --rendered FRAMES --out FILE`: all frames must be there, complete and of one run."""
    rendered, out = options.rendered.absolute(), options.out.absolute()
    output.check_output(out, options.overwrite)
    if out.suffix.lower() not in movie_file.MOVIES:
        raise UserError(f"{out.name} is not a movie; end it in {', '.join(movie_file.MOVIES)}")
    if rendered.suffix.lower() != ".png" or "#" not in rendered.name:
        raise UserError(f"{rendered.name} must be a pattern like ####.png, as render writes with --for-movie")
    check_lens(options, required=False)
    solved = None if is_blend(options.work) else load_solve(options.work)
    scene, settings, footage = open_blend(options.work) if solved is None else scene_of(solved)
    frames = movie_frames(footage, options.frames)
    files = {frame: rendered.with_name(output.numbered(rendered.name, frame)) for frame in frames}
    output.crop_to_even(scene.render)
    keys = None
    if solved is not None and has_focus(options):
        # As render --for-movie, whichever part of it.
        set_lens(settings, solved, options)
    if solved is None or has_focus(options):
        say_lens(settings, reconstruction_of(settings), frames)
        keys = frame_keys(scene, frames)
    output.check_frames(files, written_size(scene.render), keys)
    silent = contextlib.nullcontext(1) if options.debug else quiet(1)
    with output.claimed(out), silent:
        movie_file.join(scene, files, out)
    say(f"joined {counted(len(files), 'frame')}")
    say(f"wrote {options.out}")


def farm(options: argparse.Namespace) -> None:
    """Run `farm DIR --out BUNDLE`: write a movable folder with the job and all of its inputs."""
    out: Path = options.out.absolute()
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UserError(f"{out} already exists; name a new folder")
    if (
        Path(options.movie).suffix.lower() not in movie_file.MOVIES
        or Path(options.movie).name != options.movie
    ):
        raise UserError(f"{options.movie} is not a movie name; end it in {', '.join(movie_file.MOVIES)}")
    output.check_folder(out.parent)
    check_numbers(options)
    source: Path = options.footage.absolute()
    folder, texts = out / "input", _Texts()
    before = [texts.literal(word) for word in _program()[1:]]
    first = []
    if (source / STATE).is_file():
        frames = _copy_scene(source, options, folder)
        blend = f"{{{{Param.Input}}}}/{BLEND}"
    else:
        frames, copies = _copy_clip(source, options, folder)
        blend, work = f"{{{{Param.Output}}}}/{BLEND}", "{{Param.Output}}/solve"
        name, depth, segmenter = (
            f"{{{{Param.Input}}}}/{texts.literal(path.relative_to(folder).as_posix())}" if path else ""
            for path in copies
        )
        lens = f"{{{{Param.Input}}}}/{LENS}"
        # The folder keeps the solve, and a second run of an equal step takes it.
        solved = ["solve", name, "--work", work, *solve_arguments(options)]
        solved += ["--depth-maps", depth] if depth else []
        solved += ["--segmenter", segmenter] if segmenter else []
        saved = ["save", work, "--lens", lens, "--blend", blend, "--no-copy", "--overwrite"]
        saved += ["--frames", f"{frames[0]}-{frames[-1]}"]
        first = [_step("Solve", [*before, *solved]), _step("Scene", [*before, *saved], "Solve")]
    chunks = _chunks(frames, options.chunk)
    rendered = f"{{{{Param.Output}}}}/{FRAMES}"
    drawn = ["render", blend, "--for-movie", "--frames", TASK_FRAMES, "--out", rendered]
    joined = ["join", blend, "--rendered", rendered, "--frames", f"{frames[0]}-{frames[-1]}", "--overwrite"]
    joined += ["--out", f"{{{{Param.Output}}}}/{texts.literal(options.movie)}"]
    steps = [
        *first,
        _step("Render", [*before, *drawn], "Scene" if first else "", chunks),
        _step("Join", [*before, *joined], "Render"),
    ]
    try:
        files, how = FORMATS[options.format](_job(source.stem, steps, texts), out)
    except UserError:
        # Names that the farm cannot pass on.
        shutil.rmtree(folder)
        raise
    for name, text in files.items():
        atomic.write_bytes(out / name, text.encode())
    say(f"wrote {options.out}: {counted(len(frames), 'frame')} in {counted(len(chunks), 'task')}")
    say(how)


def _copy_scene(source: Path, options: argparse.Namespace, folder: Path) -> list[int]:
    """Write the .blend of a solve and all that it needs into a folder; the frames to be rendered."""
    solved = load_solve(source)
    scene, settings, footage = scene_of(solved)
    frames = movie_frames(footage, options.frames)
    movie_file.check_rate(Path(options.movie), footage, frames)
    scene.frame_start, scene.frame_end = frames[0], frames[-1]
    # Errors of the lens are reported now or never.
    set_lens(settings, solved, options, frames)
    say_lens(settings, solved.reconstruction, frames)
    clip = copy_clip(solved.open_clip(), folder)
    _copy_solve(source, folder / "solve", clip)
    copy_beside(settings, footage, folder)
    move_clip(scene, footage.part(footage.frames, clip))
    # Depth that a machine finds is kept there for the others.
    settings.work_dir = str(folder / "solve")
    scene.render.filepath = "//render/"
    write_blend(folder / BLEND)
    return frames


def _copy_clip(
    source: Path, options: argparse.Namespace, folder: Path
) -> tuple[list[int], tuple[Path | None, ...]]:
    """Copy a clip for a job; returns the frames to render, and the clip, its depth maps and the segmenter."""
    footage = open_footage(
        source, options.solve_frames, stills=options.stills, pixel_aspect=options.pixel_aspect or 0.0
    )
    frames = movie_frames(footage, options.frames)
    movie_file.check_rate(Path(options.movie), footage, frames)
    clip = copy_clip(footage.whole(), folder)
    lens = given_lens(options)
    image = image_of(options.aperture)
    copies = copied(folder, footage, options.depth, options.mask, image, options.segmenter)
    depth, _, _, segmenter = copies
    for name, copy in zip(("depth", "mask", "aperture", "segmenter"), copies, strict=True):
        if copy is not None:
            own = copy.relative_to(folder)
            lens[name] = with_image(options.aperture, own) if name == "aperture" else own
    if options.repair is not None:
        copy_file(options.repair, folder / REPAIR)
        lens["repair"] = Path(REPAIR)
    write_lens(folder / LENS, lens)
    return frames, (clip, depth, segmenter)


def _copy_solve(source: Path, target: Path, clip: Path) -> None:
    for file in [source / STATE, *(source / "model").iterdir()]:
        if file.name != STATE:
            copy_file(file, target / file.relative_to(source))
    state = read_state(source)
    assert state is not None
    # Every machine has the clip where the bundle lies there, however it writes paths.
    state |= {"footage": str(clip), "relative": f"../{clip.relative_to(target.parent).as_posix()}"}
    with atomic.staged(target / STATE) as part:
        write_state(part, state)


class _Texts:
    """The user's texts in a template: Open Job Description reads text in double braces, and has no escape.

    A text with double braces becomes a parameter of the job, whose value is not read.
    """

    def __init__(self) -> None:
        self.parameters: list[dict[str, str]] = []

    def literal(self, text: str) -> str:
        """Return a text in a template's words that stands for itself."""
        if "{{" not in text and "}}" not in text:
            return text
        name = f"Text{len(self.parameters) + 1}"
        what = {"name": name, "type": "STRING", "default": text, "description": "A name that has braces"}
        self.parameters.append(what)
        return f"{{{{Param.{name}}}}}"


def _chunks(frames: list[int], size: int) -> list[str]:
    """Ranges of frames, as `--frames` takes them."""
    least = -(-len(frames) // CHUNKS)
    if size < least:
        raise UserError(f"tasks of {size} frames make more than {CHUNKS} tasks; use --chunk {least} or more")
    parts = [frames[at : at + size] for at in range(0, len(frames), size)]
    return [f"{part[0]}-{part[-1]}" for part in parts]


def _step(name: str, words: list[str], after: str = "", frames: Sequence[str] = ()) -> dict[str, Any]:
    """A step of the template: a command once another step is done, or for each of some ranges of frames."""
    space = {"taskParameterDefinitions": [{"name": "Frames", "type": "STRING", "range": list(frames)}]}
    return {
        "name": name,
        **({"dependencies": [{"dependsOn": after}]} if after else {}),
        **({"parameterSpace": space} if frames else {}),
        "script": {"actions": {"onRun": {"command": "{{Param.Program}}", "args": words}}},
    }


def _job(name: str, steps: list[dict[str, Any]], texts: _Texts) -> dict[str, Any]:
    """The template."""
    return {
        "specificationVersion": VERSION,
        "name": re.sub(r"([{}])\1+", r"\1", f"Virtual Aperture {name}")[:128],
        "parameterDefinitions": [
            {
                "name": "Program", "type": "STRING", "default": _program()[0],
                "description": "Blender with the extension Virtual Aperture installed and enabled",
            },
            {
                "name": "Input", "type": "PATH", "objectType": "DIRECTORY", "dataFlow": "IN",
                "default": "input", "description": "The clip, its solve, and the user's masks and depth maps",
            },
            {
                "name": "Output", "type": "PATH", "objectType": "DIRECTORY", "dataFlow": "OUT",
                "default": "output", "description": "The movie, and the folder of its frames",
            },
            *texts.parameters,
        ],
        "steps": steps,
    }  # fmt: skip


def _program() -> list[str]:
    """The program that a farm's machines start, and the words before a command's name."""
    return ["blender", "--command", NAME] if bpy.app.binary_path else launcher()
