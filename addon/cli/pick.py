"""The command that measures how far a place of the picture is."""

import argparse

from ..core.focus.place import Place
from ..core.sfm.workspace import load_solve
from .lens import scene_of, set_lens
from .lens_options import add_lens, check_numbers
from .options import Commands, UsageError, path


def add_command(commands: Commands, common: argparse.ArgumentParser) -> None:
    """Add the command `pick`, which sets `command` to the function that runs it."""
    one = commands.add_parser(
        "pick", parents=[common], help="print how far places of the picture, or subjects, are"
    )
    one.description = "The distance is that at which render focuses with the same options."
    one.add_argument("work", type=path, metavar="DIR", help="folder of the solve")
    add_lens(one, required=True)
    one.set_defaults(command=pick)


def pick(options: argparse.Namespace) -> list[Place]:
    """Run `pick DIR --focus-at X,Y[@FRAME]`: print how far places and subjects are.

    Returns:
        The places, as the focus of a render would have them.

    Raises:
        UsageError: Neither a place nor a subject is given, or the options contradict each other.
        UserError: The solve cannot be read, or a place has no depth.
    """
    check_numbers(options)
    if not options.focus_at and not options.focus_subject:
        raise UsageError("pick measures a place or a subject: use --focus-at or --focus-subject; see --help")
    solved = load_solve(options.work)
    _, settings, _ = scene_of(solved)
    return set_lens(settings, solved, options)
