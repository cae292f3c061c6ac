"""The commands that make a solve, import one and judge one."""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

import bpy

from ..core.base.errors import UserError, Words
from ..core.base.streams import say
from ..core.camera.focal_length import Focal, from_equivalent, from_field_of_view, from_sensor
from ..core.media.clip import Footage, FrameRange, open_footage
from ..core.media.fixed_area import FIXED
from ..core.readers import read_reconstruction, recorded_clip, recorded_depth
from ..core.readers.matching import Imported
from ..core.sfm.process import SolveProcess, SolveProgress
from ..core.sfm.steps import table
from ..core.sfm.workspace import Solve, keep_import, load_solve
from ..scene.sources.movieclip import read_movie_clip
from ..scene.sources.scene_camera import cameras_of, read_scene_camera
from .blend import open_scene
from .depth import NOTHING, depth_of_solve
from .options import IMPORT_WORDS, Commands, UsageError, add_options, path, real


def add_commands(commands: Commands, common: argparse.ArgumentParser) -> None:
    """Add the commands `solve`, `report` and `import`; each sets `command` to its function."""
    one = commands.add_parser(
        "solve", parents=[common], help="find the camera motion and feature points of a clip"
    )
    add_footage(one)
    one.add_argument("--work", type=path, required=True, metavar="DIR", help="folder of the solve")
    add_solve_frames(one, "--frames", "frames of the clip to solve")
    one.add_argument(
        "--depth-maps", type=path, metavar="PATH",
        help="your own depth maps, for a clip whose camera only turns or does not move",
    )  # fmt: skip
    one.add_argument(
        "--segmenter", type=path, metavar="FILE.onnx",
        help="your own salient-object network: a clip that is refused is solved without what stands out",
    )  # fmt: skip
    one.add_argument("--depth", action="store_true", help="also find and keep the depth of all frames")
    add_options(one, {FIXED.name: FIXED})
    one.set_defaults(command=solve)
    two = commands.add_parser("report", parents=[common], help="how good a solve is, and advice")
    two.add_argument("work", type=path, metavar="DIR", help="folder of the solve")
    form = two.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="machine-readable")
    form.add_argument("--verbose", action="store_true", help="also the attempts of the solver")
    two.set_defaults(command=report)
    three = commands.add_parser("import", parents=[common], help="import a solve from another program")
    model = three.add_mutually_exclusive_group(required=True)
    model.add_argument("--blend", type=path, metavar="FILE", help="a .blend as MODEL")
    model.add_argument(
        "model", type=path, nargs="?", metavar="MODEL",
        help="COLMAP model, bundle.out, .nvm, Voodoo text export, transforms.json, .npz of MegaSaM, ViPE or"
        " Depth Anything 3, .r3d, folder of Stray Scanner, or a .blend with a solved movie clip or, with"
        " --camera, an animated camera",
    )  # fmt: skip
    three.add_argument(
        "--footage",
        type=path,
        metavar="FOOTAGE",
        help="the clip that was solved (a phone's recording includes it)",
    )
    three.add_argument("--work", type=path, required=True, metavar="DIR", help="folder of the solve")
    add_solve_frames(three, "--frames", "frames of the clip that were solved (all)")
    which = three.add_mutually_exclusive_group()
    which.add_argument("--clip", metavar="NAME", help="the movie clip in the .blend")
    which.add_argument(
        "--camera", metavar="NAME", help="the animated camera in the .blend that matches the clip"
    )
    three.add_argument(
        "--offset", type=int, default=0, metavar="N",
        help="with --camera: how many frames later the scene starts than the clip (0)",
    )  # fmt: skip
    add_pixel_aspect(three)
    three.add_argument("--again", action="store_true", help="replace this clip's solve in the folder")
    three.set_defaults(command=import_model, words=IMPORT_WORDS)


def add_footage(
    command: argparse.ArgumentParser,
    name: str = "FOOTAGE",
    description: str = "video, folder of images, or pattern",
) -> None:
    """Add the arguments of a clip to solve, called `name` and described as `description`."""
    command.add_argument("footage", type=path, metavar=name, help=description)
    focal = command.add_mutually_exclusive_group()
    focal.add_argument("--focal", type=real, metavar="PX", help="known focal length in pixels")
    focal.add_argument("--focal35", type=real, metavar="MM", help="known focal length, 35 mm equivalent")
    focal.add_argument("--fov", type=real, metavar="DEG", help="known horizontal field of view")
    focal.add_argument(
        "--focal-mm", type=real, metavar="MM", help="known focal length of the lens itself, with --sensor-mm"
    )
    focal.add_argument(
        "--zoom", action="store_true", help="the clip was shot with a zoom lens whose focal length changes"
    )
    command.add_argument("--sensor-mm", type=real, metavar="MM", help="width of the sensor, with --focal-mm")
    command.add_argument(
        "--stills", action="store_true", help="the folder holds unordered photos, not a clip"
    )
    add_pixel_aspect(command)
    command.add_argument(
        "--again", action="store_true", help="solve even if the folder already holds this solve"
    )


def add_pixel_aspect(command: argparse.ArgumentParser) -> None:
    """Add `--pixel-aspect`."""
    command.add_argument(
        "--pixel-aspect", type=real, metavar="X",
        help="width of a pixel by its height, such as 2 for pictures squeezed to half their width (what the"
        " file says, else 1)",
    )  # fmt: skip


def add_solve_frames(
    command: argparse.ArgumentParser,
    name: str = "--solve-frames",
    text: str = "frames of the clip to solve, such as one of several shots (all)",
) -> None:
    """Add the frames to solve: `--solve-frames` where a command's `--frames` are the rendered ones."""
    command.add_argument(name, dest="solve_frames", type=FrameRange.parse, metavar="A-B[:STEP]", help=text)


def solve_arguments(options: argparse.Namespace) -> list[str]:
    """Return the options of `add_footage` as words for another process's command line, without the clip."""
    words = []
    for name in ("focal", "focal35", "fov", "focal_mm", "sensor_mm", "pixel_aspect"):
        if (value := getattr(options, name)) is not None:
            words += [f"--{name.replace('_', '-')}", str(value)]
    words += ["--frames", str(options.solve_frames)] if options.solve_frames else []
    whole = ["--fixed", "off"] if options.fixed is False else []
    return [*words, *whole, *["--zoom"] * options.zoom, *["--stills"] * options.stills]


def solve(options: argparse.Namespace) -> None:
    """Run `solve FOOTAGE --work DIR [--depth]`."""
    solved = solve_clip(options, options.work, depth_maps=options.depth_maps)
    say_quality(solved, options.words)
    given = {"frames": None, "fixed": options.fixed, "segmenter": options.segmenter}
    whole = argparse.Namespace(**NOTHING, **given)
    if options.depth and (problem := depth_of_solve(solved, whole)):
        say(f"note: {problem.worded(options.words)}")


def say_quality(solved: Solve, words: Words) -> None:
    """Print the report on a solve, and advice."""
    say("\n".join(filter(None, (solved.summary, solved.quality.advised(words)))))


def solve_clip(
    options: argparse.Namespace,
    work: Path,
    check: Callable[[Footage], object] = lambda _: None,
    depth_maps: Path | None = None,
) -> Solve:
    """Solve the clip into the folder, or take the existing solve.

    Args:
        options: Those of the command.
        work: Working folder.
        check: Called with the clip first; its error ends the solve.
        depth_maps: The user's.
    """
    process = SolveProcess(
        options.footage, work.absolute(), options.solve_frames, _focal(options), options.again,
        options.zoom, depth_maps=depth_maps, stills=options.stills, pixel_aspect=options.pixel_aspect or 0.0,
        fixed=options.fixed is not False, segmenter=options.segmenter and options.segmenter.absolute(),
    )  # fmt: skip
    _wait(process, check)
    return load_solve(work.absolute(), process.clip.path)


def _wait(process: SolveProcess, check: Callable[[Footage], object] = lambda _: None) -> None:
    line = _ProgressLine()
    try:
        check(process.clip)
        process.wait(line.show)
    finally:
        process.cancel()


def report(options: argparse.Namespace) -> None:
    """Run `report DIR [--json | --verbose]`."""
    solved = load_solve(options.work.absolute())
    quality = solved.quality
    say(json.dumps(quality.as_dict(), indent=1) if options.json else quality.text(options.words))
    if options.verbose:
        say(table(solved.figures.attempts))


def import_model(options: argparse.Namespace) -> None:
    """Run `import MODEL --footage FOOTAGE --work DIR`."""
    work: Path = options.work.absolute()
    if options.offset and options.camera is None:
        raise UsageError("--offset needs --camera; name the camera it applies to")
    options.model = options.model or options.blend
    clip = options.footage or recorded_clip(options.model)
    if clip is None:
        raise UsageError("--footage is needed: the model does not include its clip; see --help")
    aspect = options.pixel_aspect or 0.0
    footage = open_footage(clip, options.solve_frames, pixel_aspect=aspect)
    if options.camera is not None:
        found = _scene_camera(options, footage)
    elif options.model.suffix.lower() == ".blend":
        found = _from_blend(options.model, options.clip, footage)
    else:
        found = read_reconstruction(options.model, footage)
    if found.lacks_points:
        _wait(SolveProcess(
            footage.path, work, options.solve_frames, again=options.again, cameras=found, pixel_aspect=aspect
        ))  # fmt: skip
    else:
        keep_import(found, footage, work, options.again)
    depth = recorded_depth(options.model, work) if options.camera is None else None
    solved = load_solve(work, footage.path)
    say(f"{found.format}: {solved.summary}")
    for note in solved.quality.notes:
        say(f"note: {note}")
    if depth is not None:
        say(f"note: the phone's LiDAR depth is in {depth}: render with --depth {depth}")
    if advice := solved.quality.advised(options.words):
        say(advice)


def _scene_camera(options: argparse.Namespace, footage: Footage) -> Imported:
    """The camera of a .blend, in whichever of its scenes it is."""
    scene = open_scene(options.model)
    scenes = [scene, *(other for other in bpy.data.scenes if other != scene)]
    there = {thing.name: (each, thing) for each in reversed(scenes) for thing in cameras_of(each)}
    if options.camera not in there:
        have = ", ".join(sorted(there)) or "none"
        raise UserError(f"{options.model.name} has no camera {options.camera!r} (it has: {have})")
    return read_scene_camera(*there[options.camera], footage, options.offset)


def _from_blend(path: Path, name: str | None, footage: Footage) -> Imported:
    if not path.is_file():
        raise UserError(f"{path} does not exist")
    try:
        with bpy.data.libraries.load(str(path.absolute()), link=False) as (there, here):
            names = list(there.movieclips)
            wanted = [each for each in names if name in (None, each)]
            if len(wanted) != 1:
                have = ", ".join(names) or "none"
                raise UserError(f"{path.name} needs one movie clip; name it with --clip (it has: {have})")
            here.movieclips = wanted
    except OSError as error:
        raise UserError(f"{path} cannot be read as a .blend: {error}") from None
    return read_movie_clip(here.movieclips[0], footage)


def _focal(options: argparse.Namespace) -> Focal | None:
    """The focal length by the options."""
    focal_mm, sensor_mm = options.focal_mm, options.sensor_mm
    if sensor_mm is not None and focal_mm is None:
        raise UserError("--sensor-mm needs --focal-mm, the lens's focal length")
    if focal_mm is not None and sensor_mm is None:
        raise UserError(
            "--focal-mm needs --sensor-mm, the width of the sensor; or give the lens's 35 mm equivalent"
            " with --focal35"
        )
    if focal_mm is not None:
        return lambda width, _: from_sensor(focal_mm, sensor_mm, width)
    if options.fov is not None:
        return lambda width, _: from_field_of_view(options.fov, width)
    if options.focal35 is not None:
        return lambda width, height: from_equivalent(options.focal35, width, height)
    pixels: float | None = options.focal
    return pixels


class _ProgressLine:
    """One line a stage and every few seconds, with the time left."""

    def __init__(self) -> None:
        self._shown = time.monotonic()
        self._stage = ""

    def show(self, step: SolveProgress) -> None:
        now = time.monotonic()
        stage = step.text.rsplit(" ", 1)[0]
        if stage == self._stage and now - self._shown < 5:
            return
        self._stage, self._shown = stage, now
        remaining = f", about {step.left:.0f} s left" if step.left is not None else ""
        say(f"solving: {step.text}{remaining}")
