"""Our command lines in the documents are understood, and commands have the options they are named by."""

from __future__ import annotations

import argparse
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from addon.cli.main import parser
from addon.core.base.errors import UserError

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
PROGRAM = re.compile(
    r"(?:python addon/headless\.py|blender -b --python addon/headless\.py --|blender --command "
    r"virtual_aperture|\bva) +"
)
"""What stands before a command; `va` is the shell function of docs/farm.md."""
COMMANDS: dict[str, argparse.ArgumentParser] = next(
    dict(each.choices) for each in parser()._actions if isinstance(each, argparse._SubParsersAction)
)
SHELL = {
    "$lens": "--focus-at 0.5,0.6 --blur 0.03",
    "$first-$((first + 11))": "1-12",
    "X,Y[@FRAME]": "0.5,0.5",
    "X,Y@FRAME": "0.5,0.5@1",
    "A-B[:STEP]": "1-9:2",
    "A-B": "1-9",
    "X,Y": "0.5,0.5",
    " D ": " 5 ",
    " N ": " 1 ",
    " F ": " 0.03 ",
    " FRAME": " 1",
}
"""Texts that stand for a value."""


def blocks_and_spans(text: str) -> tuple[list[str], list[str]]:
    """The lines of the fenced blocks of a document, and the code within its lines."""
    fence = re.compile(r"^```\w*\n(.*?)^```", re.M | re.S)
    lines = [line for block in fence.findall(text) for line in block.splitlines()]
    return lines, re.findall(r"`([^`\n]+)`", fence.sub("", text))


def documented() -> Iterator[tuple[str, str]]:
    """Each document and command line in its blocks."""
    for document in DOCUMENTS:
        for line in blocks_and_spans(document.read_text())[0]:
            command = re.split(
                r" [|&>]|  +#", line[found.end() :] if (found := PROGRAM.search(line)) else line
            )[0]
            is_ours = found or (command.partition(" ")[0] in COMMANDS and " --" in command)
            if is_ours and not re.search(r"\.\.\.|ARGS|\"\$@\"", command):
                yield document.relative_to(ROOT).as_posix(), command


def named() -> Iterator[tuple[str, str]]:
    """Each document and command that is named with options: `export --what`, `render DIR --out OUT`."""
    for document in DOCUMENTS:
        for span in blocks_and_spans(document.read_text())[1]:
            command = PROGRAM.sub("", span)
            if command.partition(" ")[0] in COMMANDS and " --" in command:
                yield document.relative_to(ROOT).as_posix(), command


def words(command: str) -> list[str]:
    """A command's words, with values in place of texts that stand for some."""
    for text, value in SHELL.items():
        command = f"{command} ".replace(text, value)
    return shlex.split(command)


def unknown(command: str) -> set[str]:
    """Options in the name of a command that it does not have."""
    name = command.partition(" ")[0]
    return (
        set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", command)) - COMMANDS[name]._option_string_actions.keys()
    )


def test_there_are_commands() -> None:
    assert len(set(documented())) > 15 and len(set(named())) > 30


@pytest.mark.parametrize(("document", "command"), dict.fromkeys(documented()))
def test_a_command_line_is_understood(document: str, command: str) -> None:
    try:
        parser().parse_args(words(command))
    except UserError as error:
        raise AssertionError(f"{document}: {command}: {error}") from None
    except SystemExit as ended:
        assert ended.code == 0 and command.endswith("--help")


@pytest.mark.parametrize(("document", "command"), dict.fromkeys(named()))
def test_a_command_has_the_options_it_is_named_with(document: str, command: str) -> None:
    assert unknown(command) == set(), document
