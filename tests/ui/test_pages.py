"""What the documentation's pages quote is what the interface says: names of buttons and panels, messages."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import bpy
import pytest

import addon

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / "README.md",
    *(ROOT / "docs" / f"{name}.md" for name in (
        "first_clip", "focus_pull", "lens", "people", "masks", "bring_your_own", "compositing",
        "troubleshooting", "photos",
    )),
]  # fmt: skip
VARIES = "\0"
"""What a message fills in."""
WRITTEN = re.compile(r"(?<!\*)\*([^*|]+?)\*(?!\*)")
"""Italics: names as the interface writes them."""


@cache
def messages() -> frozenset[str]:
    """Every string of the add-on as the user may read it, what is filled in as `VARIES`."""
    found: set[str] = set()
    for path in Path(addon.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.JoinedStr):
                parts = [part.value if isinstance(part, ast.Constant) else VARIES for part in node.values]
                found.add("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(node.value)
    return frozenset(found)


def is_said(quoted: str) -> bool:
    """Whether a message is one of the add-on's: `...` stands for anything."""
    parts = [part.strip(" ") for part in quoted.split("...")]
    pattern = re.compile(".*".join(map(re.escape, parts)), re.S)
    return any(pattern.search(message) for message in messages())


def is_filled_in(text: str) -> bool:
    """Whether a text is one of the add-on's messages with everything filled in."""
    return any(
        re.fullmatch(".*".join(map(re.escape, message.split(VARIES))), text)
        for message in messages()
        # Else it would be any text.
        if VARIES in message and len(message.replace(VARIES, "").strip()) > 5
    )


@cache
def labels() -> frozenset[str]:
    """Every name that Blender with the add-on may write: of types, properties, items, operators, menus."""
    found: set[str] = set()
    kinds = [getattr(bpy.types, name) for name in dir(bpy.types)]
    for kind in (*kinds, *bpy.types.PropertyGroup.__subclasses__()):
        found.add(getattr(kind, "bl_label", ""))
        rna = getattr(kind, "bl_rna", None)
        if rna is not None:
            found.update((rna.name, *_properties(rna)))
    for group in dir(bpy.ops):
        for name in dir(getattr(bpy.ops, group)):
            rna = getattr(getattr(bpy.ops, group), name).get_rna_type()
            found.update((rna.name, *_properties(rna)))
    return frozenset(found)


def _properties(rna: bpy.types.Struct) -> Iterator[str]:
    for each in rna.properties:
        yield each.name
        if each.type == "ENUM":
            yield from (item.name for item in each.enum_items)


OF_BLENDER = {
    "Get Extensions", "Install from Disk", "Add-ons", "New Scene", "File", "Edit", "Multi-Layer EXR",
    "Clear Keyframes", "Universal Scene Description", "Alembic", "Time Remapping", "Use for Rendering",
}  # fmt: skip
"""What Blender writes by code of its own, seen in its window."""


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_names_are_those_of_the_interface(registered: None, page: Path) -> None:
    text = re.sub(r"^```\n.*?^```", "", page.read_text(), flags=re.M | re.S)
    if page.name == "README.md":
        # Elsewhere italics are captions.
        text = text[text.index("## In Blender") : text.index("## On the command line")]
    # A name may be broken between two lines.
    text = re.sub(r"(?<!\n)\n(?!\n)", " ", text)
    presets = {bpy.path.display_name(str(path), title_case=False) for path in ROOT.rglob("presets/**/*.py")}
    known = labels() | messages() | presets | OF_BLENDER
    unknown = [
        name
        for name in dict.fromkeys(" ".join(each.split()) for each in WRITTEN.findall(text))
        if name not in known and not is_filled_in(name) and f"{name}: {VARIES}{VARIES}" not in known
    ]
    assert unknown == []


def quoted() -> list[str]:
    """The messages that the page of messages quotes."""
    text = (ROOT / "docs" / "troubleshooting.md").read_text()
    spans = [" ".join(each.split()) for each in re.findall(r"`([^`]+)`", text)]
    return [span for span in spans if span != "..." and not span.endswith(".png")]


def test_messages_are_quoted() -> None:
    assert len(quoted()) > 40


def test_quoted_messages_are_ours() -> None:
    assert [message for message in quoted() if not is_said(message)] == []


def test_a_message_that_nobody_says_is_told() -> None:
    assert not is_said("the moon is ... too far away")
    assert not is_filled_in("the moon is too far away")


def test_every_picture_is_shown_and_light() -> None:
    shown = set(re.findall(r"pictures/(\w+\.(?:jpg|webp))\)", "".join(page.read_text() for page in PAGES)))
    there = {path.name: path.stat().st_size for path in (ROOT / "docs" / "pictures").iterdir()}
    assert set(there) == shown
    # Pages are read over slow lines, too.
    heavy = {name for name, size in there.items() if size > (65_000 if name.endswith(".jpg") else 1_000_000)}
    assert heavy == set()
