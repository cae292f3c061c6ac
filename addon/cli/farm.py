"""The commands for farms: a job's bundle, and joining the frames that its machines rendered."""

from __future__ import annotations

import argparse
import contextlib
import json
import re
from pathlib import Path
from typing import Any

import bpy

from ..core.base import atomic
from ..core.base.counting import counted
from ..core.base.errors import UserError
from ..core.base.streams import say
from ..core.depth.user_maps import open_depth
from ..core.media.clip import Footage, FrameRange, open_footage
from ..core.media.copying import copy_clip, copy_file, copy_pictures
from ..core.media.masks import open_masks
from ..core.sfm.state import STATE, read_state, write_state
from ..core.sfm.workspace import load_solve
from ..render import movie_file, output
from ..render.frame_keys import frame_keys
from ..render.frame_size import written_size
from ..render.launcher import launcher
from ..render.quiet import quiet
from . import NAME
from .aperture import copy_image
from .lens import (
    add_lens,
    at_frame,
    check_numbers,
    has_focus,
    lens_arguments,
    movie_frames,
    pinned,
    say_lens,
    scene_of,
    set_lens,
    wanted_frames,
)
from .options import whole
from .paths import path
from .save import DEPTH, MASKS
from .solve import add_footage, add_solve_frames, solve_arguments
from .words import SOLVED_WORDS

TEMPLATE = "template.json"
VERSION = "jobtemplate-2023-09"
CHUNKS = 1024
"""The most values that Open Job Description lets a task parameter list."""
FRAMES = "frames/######.png"


def add_commands(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], common: argparse.ArgumentParser
) -> None:
    """`farm` and `join`; each sets `command` to the function that runs it."""
    one = commands.add_parser(
        "farm", parents=[common], help="write a job for render farms, in the Open Job Description format"
    )
    one.description = "The job renders chunks of frames side by side and joins them to a movie with sound."
    add_footage(one, "DIR|FOOTAGE", "folder that keeps the solve, or the clip: then the job solves it first")
    one.add_argument("--out", type=path, required=True, metavar="BUNDLE", help="folder for the job")
    one.add_argument("--chunk", type=whole(1), default=12, metavar="N", help="frames a task (default 12)")
    one.add_argument("--frames", type=FrameRange.parse, metavar="A-B", help="frames to render")
    add_solve_frames(one)
    one.add_argument("--movie", default="movie.mp4", metavar="NAME", help="the movie's name (movie.mp4)")
    add_lens(one, required=True)
    one.set_defaults(command=farm, words=SOLVED_WORDS)

    two = commands.add_parser("join", parents=[common], help="join rendered frames to a movie with sound")
    two.description = (
        "With the focus and all else as for render, frames made with other settings are refused."
    )
    two.add_argument("work", type=path, metavar="DIR", help="folder that keeps the solve")
    two.add_argument(
        "--rendered", type=path, required=True, metavar="DIR/####.png", help="frames of render --for-movie"
    )
    two.add_argument("--out", type=path, required=True, metavar="FILE.mp4")
    two.add_argument("--frames", type=FrameRange.parse, metavar="A-B", help="frames that the movie shows")
    two.add_argument("--overwrite", action="store_true", help="replace the movie if it exists")
    add_lens(two, required=False)
    two.set_defaults(command=join)


def join(options: argparse.Namespace) -> None:
    """`join DIR --rendered FRAMES --out FILE`: all frames are there, whole and of one run, or it fails."""
    rendered, out = options.rendered.absolute(), options.out.absolute()
    output.check_output(out, options.overwrite)
    if out.suffix.lower() not in movie_file.MOVIES:
        raise UserError(f"{out.name} is no movie; end it in {', '.join(movie_file.MOVIES)}")
    if rendered.suffix.lower() != ".png" or "#" not in rendered.name:
        raise UserError(f"{rendered.name} must be a pattern like ####.png, as render writes with --for-movie")
    check_numbers(options)
    solved = load_solve(options.work)
    scene, settings, _ = scene_of(solved)
    frames = movie_frames(solved, options.frames)
    files = {frame: rendered.with_name(output.numbered(rendered.name, frame)) for frame in frames}
    output.crop_to_even(scene.render)
    keys = None
    if has_focus(options):
        # As render --for-movie, whichever part of it.
        set_lens(settings, solved, options)
        say_lens(settings, solved.reconstruction, frames)
        keys = frame_keys(scene, frames)
    output.check_frames(files, written_size(scene.render), keys)
    silent = contextlib.nullcontext(1) if options.debug else quiet(1)
    with output.claimed(out), silent:
        movie_file.join(scene, files, out)
    say(f"joined {counted(len(files), 'frame')}")
    say(f"wrote {options.out}")


def farm(options: argparse.Namespace) -> None:
    """`farm DIR --out BUNDLE`: a folder with the job and all that it reads, to be moved as it is."""
    out: Path = options.out.absolute()
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UserError(f"{out} exists; name a folder that is not there yet")
    if (
        Path(options.movie).suffix.lower() not in movie_file.MOVIES
        or Path(options.movie).name != options.movie
    ):
        raise UserError(f"{options.movie} is no name of a movie; end it in {', '.join(movie_file.MOVIES)}")
    output.check_folder(out.parent)
    check_numbers(options)
    source: Path = options.footage.absolute()
    is_solved = (source / STATE).is_file()
    folder = out / "input"
    if is_solved:
        solved = load_solve(source)
        footage = solved.open_clip(solved.frames)
        # What the lens asks for is wrong now or never.
        _scene, settings, _ = scene_of(solved)
        frames = movie_frames(solved, options.frames)
        set_lens(settings, solved, options, frames)
        say_lens(settings, solved.reconstruction, frames)
        words = pinned(options, settings, depth=None, mask=None, aperture=None)
        clip = copy_clip(solved.open_clip(), folder)
        _copy_solve(source, folder / "solve", clip)
    else:
        footage = open_footage(source, options.solve_frames)
        wanted = wanted_frames(footage, options.frames)
        frames = list(open_footage(source, FrameRange(wanted[0], wanted[-1])).frames)
        clip = copy_clip(open_footage(source), folder)
        words = lens_arguments(at_frame(options, frames[0]), depth=None, mask=None, aperture=None)
    texts = _Texts()
    lens = words + _pictures(options, footage, folder, texts)
    name = _in_bundle(clip, folder, texts)
    job = _job(options, _chunks(frames, options.chunk), lens, None if is_solved else name, texts)
    atomic.write_bytes(out / TEMPLATE, (json.dumps(job, indent=1) + "\n").encode())
    tasks = counted(len(job["steps"][-2]["parameterSpace"]["taskParameterDefinitions"][0]["range"]), "task")
    say(f"wrote {options.out}: {counted(len(frames), 'frame')} in {tasks}")
    say(f"run it here: openjd run {out / TEMPLATE} --step Join --run-dependencies")


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
    """The user's texts as a template can hold them: Open Job Description reads what is in double braces, and
    knows no escape. A text that has some is a parameter of the job, whose value is not read."""

    def __init__(self) -> None:
        self.parameters: list[dict[str, str]] = []

    def literal(self, text: str) -> str:
        """A text in a template's words that stands for itself."""
        if "{{" not in text and "}}" not in text:
            return text
        name = f"Text{len(self.parameters) + 1}"
        what = {"name": name, "type": "STRING", "default": text, "description": "A name that has braces"}
        self.parameters.append(what)
        return f"{{{{Param.{name}}}}}"


def _pictures(options: argparse.Namespace, footage: Footage, folder: Path, texts: _Texts) -> list[str]:
    """Copy the user's depth maps, masks and aperture's picture into the bundle; the words that lead there."""
    words = []
    if options.depth:
        maps = open_depth(options.depth.absolute(), footage).maps
        words += ["--depth", _in_bundle(copy_pictures(maps, folder / DEPTH), folder, texts)]
    if options.mask:
        pictures = open_masks(options.mask.absolute(), footage).pictures
        words += ["--mask", _in_bundle(copy_pictures(pictures, folder / MASKS), folder, texts)]
    if options.aperture:
        shape, copy = copy_image(options.aperture, folder)
        place = _in_bundle(copy, folder, texts) if copy else ""
        words += ["--aperture", *(word.replace(str(copy), place) if copy else word for word in shape)]
    return words


def _in_bundle(path: Path, folder: Path, texts: _Texts) -> str:
    """The path of what lies in the input folder, for the machine that runs the job."""
    return f"{{{{Param.Input}}}}/{texts.literal(path.relative_to(folder).as_posix())}"


def _chunks(frames: list[int], size: int) -> list[str]:
    """Ranges of frames, as `--frames` takes them."""
    least = -(-len(frames) // CHUNKS)
    if size < least:
        raise UserError(f"tasks of {size} frames are more than {CHUNKS}; give --chunk {least} or more")
    parts = [frames[at : at + size] for at in range(0, len(frames), size)]
    return [f"{part[0]}-{part[-1]}" for part in parts]


def _job(
    options: argparse.Namespace, chunks: list[str], lens: list[str], clip: str | None, texts: _Texts
) -> dict[str, Any]:
    """The template. `clip` is the path of one that is to be solved first."""
    program, *before = (texts.literal(word) if at else word for at, word in enumerate(_program()))
    work = "{{Param.Output}}/solve" if clip else "{{Param.Input}}/solve"

    def step(name: str, words: list[str], after: str = "", **others: Any) -> dict[str, Any]:
        run = {"command": "{{Param.Program}}", "args": [*before, *words]}
        dependencies = {"dependencies": [{"dependsOn": after}]} if after else {}
        return {"name": name, **dependencies, **others, "script": {"actions": {"onRun": run}}}

    steps = []
    if clip:
        # The folder keeps the solve, and a second run of an equal step takes it.
        words = ["solve", clip, "--work", work, *solve_arguments(options)]
        steps.append(step("Solve", words))
    rendered = f"{{{{Param.Output}}}}/{FRAMES}"
    words = ["render", work, *lens, "--for-movie", "--frames", "{{Task.Param.Frames}}", "--out", rendered]
    space = {"taskParameterDefinitions": [{"name": "Frames", "type": "STRING", "range": chunks}]}
    steps.append(step("Render", words, "Solve" if clip else "", parameterSpace=space))
    words = ["join", work, *lens, "--rendered", rendered, "--overwrite"]
    words += ["--frames", str(options.frames)] if options.frames else []
    steps.append(
        step("Join", [*words, "--out", f"{{{{Param.Output}}}}/{texts.literal(options.movie)}"], "Render")
    )
    return {
        "specificationVersion": VERSION,
        "name": re.sub(r"([{}])\1+", r"\1", f"Virtual Aperture {options.footage.stem}")[:128],
        "parameterDefinitions": [
            {
                "name": "Program", "type": "STRING", "default": program,
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
