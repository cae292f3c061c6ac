"""The public Python interface: five functions for scripts and pipelines, stable from 1.0 on.

    from bl_ext.user_default.virtual_aperture import UserError, depth, export, pick, render, solve

Each function is the command of its name and shares its parser, checks and work (docs/python.md). Options of
the command are keyword arguments with underscores for dashes, and have the same units. The functions print
their progress. All but `solve` open a scene of their own and thereby close the open file, so that they
run without a window alone: `blender -b --python SCRIPT.py`.
"""

import json
from collections.abc import Iterable
from os import PathLike
from typing import Any

from .core.base.errors import UserError
from .core.base.memory import keep_freed

type Path = str | PathLike[str]
type Value = str | float | bool | PathLike[str] | Iterable[str | float | Iterable[str | float]] | None

__all__ = ["UserError", "depth", "export", "pick", "render", "solve"]
REPEATED = {"focus_at", "focus_subject", "subject"}
"""Options that a command takes several times; each item of a list is one of them."""


def solve(clip: Path, work: Path, **options: Value) -> dict[str, Any]:
    """Find the cameras and points of a clip, and keep them in a folder; an existing solve is taken.

    Args:
        clip: Video, folder of pictures, or pattern.
        work: Folder of the solve.
        **options: Options of the command `solve`, such as `frames="1-48"`, `focal35=26` or `again=True`.

    Returns:
        The report on the solve as `report --json` has it; docs/reports.schema.json describes each field.

    Raises:
        UserError: The clip cannot be solved, or an option is not valid.
    """
    _command("solve", clip, work=work, **options)
    from .core.sfm.workspace import load_solve

    report: dict[str, Any] = json.loads(json.dumps(load_solve(_absolute(work)).quality.as_dict()))
    return report


def pick(work: Path, x: float, y: float, frame: int | None = None, **options: Value) -> dict[str, Any]:
    """Measure the distance of the surface, or of the subject, at a place of a frame.

    Args:
        work: Folder of the solve.
        x: Fraction of the picture's width, 0 at its left.
        y: Fraction of the picture's height, 0 at its top.
        frame: Number of the frame; the first one by default.
        **options: Options of the command `pick`, such as `depth="maps"`.

    Returns:
        `distance` along the optical axis in the solve's unit, `frame`, `source` in words, and `subject`,
        the kind of subject at the place, or empty.

    Raises:
        UserError: The depth of the place is unknown, or an option is not valid.
    """
    at = f"{x!r},{y!r}" + (f"@{frame}" if frame is not None else "")
    (place,) = _command("pick", work, focus_at=at, **options)
    return {
        "distance": place.distance, "frame": place.frame, "source": place.source, "subject": place.subject
    }  # fmt: skip


def depth(source: Path, **options: Value) -> None:
    """Find the depth of a clip's frames and keep it beside the solve, where renders read it.

    Args:
        source: Folder of the solve, or a .blend that `save` wrote.
        **options: Options of the command `depth`, such as `frames="1-48"` or `jobs=4`.

    Raises:
        UserError: Depth cannot be found or kept, or an option is not valid.
    """
    _command("depth", source, **options)


def render(source: Path, out: Path, **options: Value) -> None:
    """Render a clip with depth of field; frames that are complete already are kept.

    Args:
        source: Folder of the solve, or a .blend, which has a lens.
        out: `FILE.mp4`, `FILE.mov`, `FILE.mkv`, `FOLDER/####.png` or `FOLDER/####.exr`.
        **options: Options of the command `render`, such as `focus_at="0.5,0.6"`, `blur=0.03` or
            `quality="draft"`. Several `focus_at`, as a list of "X,Y@FRAME", pull focus.

    Raises:
        UserError: A frame cannot be rendered or written, or an option is not valid.
    """
    _command("render", source, out=out, **options)


def export(source: Path, out: Path, what: str = "layers", **options: Value) -> None:
    """Export frames in two layers, or the distortion of the lens, for compositing.

    Args:
        source: Folder of the solve, or a .blend, which has a lens.
        out: Folder for the files.
        what: "layers" or "stmap".
        **options: Options of the command `export`, such as `focus_at="0.5,0.6"`, or `frames="1-48"`.

    Raises:
        UserError: A file cannot be written, or an option is not valid.
    """
    _command("export", source, out=out, what=what, **options)


def _command(name: str, *arguments: Path, **options: Value) -> Any:
    """Run a command of the command line; its result."""
    from .cli.main import parser

    if name != "solve":
        _check_background()
    parsed = parser().parse_args([name, *(str(_absolute(each)) for each in arguments), *_words(options)])
    try:
        return parsed.command(parsed)
    except UserError as error:
        # Scripts have the options of the command line.
        raise UserError(error.worded(parsed.words)) from error


def _words(options: dict[str, Value]) -> list[str]:
    """Options as the command line has them."""
    from .core.frame.options import FRAME_OPTIONS

    words = list[str]()
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if isinstance(value, bool) and not (name in FRAME_OPTIONS and FRAME_OPTIONS[name].kind is bool):
            words += [flag] * value
        elif isinstance(value, bool):
            words.append(f"{flag}={'on' if value else 'off'}")
        elif isinstance(value, str | float | int | PathLike):
            words.append(f"{flag}={value}")
        elif value is not None:
            for each in value if name in REPEATED else [value]:
                items = each if isinstance(each, Iterable) else [each]
                words += [f"{flag}={each}"] if isinstance(each, str) else [flag, *map(str, items)]
    return words


def _absolute(path: Path) -> Any:
    from pathlib import Path as File

    return File(path).absolute()


def _check_background() -> None:
    """UserError in a window, whose open file would be closed."""
    import bpy

    if not bpy.app.background:
        raise UserError("a scene of its own would close the open file; use blender -b --python SCRIPT.py")
    keep_freed()
