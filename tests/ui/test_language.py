"""Labels, tooltips, messages and pages speak as photographers and Blender's own interface do, and have one
name for one thing."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import bpy

import addon
from addon.core.base.errors import Remedy
from addon.scene.base.remedy_words import WORDS as REMEDIES

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
GUIDES = [
    ROOT / "README.md",
    *(ROOT / "docs" / f"{name}.md" for name in (
        "index", "first_clip", "focus_pull", "lens", "masks", "compositing", "photos", "troubleshooting",
    )),
]  # fmt: skip
"""Pages for whoever uses Blender's interface, which are to read as it does."""

RETIRED_NAMES = {
    "Before": "Compare",
    "Carry Through Clip": "Track Through Clip",
    "Clipped From": "Clipping Threshold",
    "Key by Focus Marks Again": "Restore Focus Mark Keys",
    "Mark at Frame": "Mark Frame",
    "Photos in No Order": "Unordered Photos",
    "Use It There": "Use New Location",
    "What is worth its time": "Recommended",
    "Zooms": "Zoom Lens",
}
"""Names that things had, and what they are called now."""

RETIRED_WORDS = {
    r"\blamps?\b": "highlights, where bokeh is meant",
    r"\bis worth its time\b|\bwished\b": "recommended, target",
    r"\bnone needed\b": "nothing",
    r"\bphotos? in no order\b": "unordered photos",
    r"(?<![Tt]here )\b(is|are) no (?!longer\b|more\b)": "is not a",
    r"\bany more\b(?! than)": "no longer",
    r"\bmeanwhile\b": "in the meantime",
    r", for (the|it|they) ": "because",
    r"\bfor one\b(?! number)": "for example",
    r"\b(is|are) to be (sharp|in focus|solved|seen)\b": "should be",
    r"\bround the middle\b": "near the centre",
    r"\b[Tt]ake in\b|\btaken in\b": "import",
    r"\bnot understood\b": "not valid",
    r"\bas a whole\b": "completely",
    r"\btells? (no|it)\b": "shows no",
    r"\bby itself\b|\bby themselves\b|\bmoves by\b": "on its own, moving",
    r"\bbeyond it\b|\b(blue|warm|lies) before\b|\bbefore the focus\b": "nearer, farther, in front of",
    r"\b(frame|picture|clip) it was shot\b": "as it was shot",
    r"\bplaces? in space\b": "3D position",
    r"\bmade up\b": "invented",
}
"""Patterns of what reads as if it had been translated, and what is said in its place."""


def _retired(text: str) -> list[str]:
    return [f"{found[0]!r} in {text!r}: {better}"
            for pattern, better in RETIRED_WORDS.items() if (found := re.search(pattern, text))]  # fmt: skip


@cache
def shown() -> tuple[str, ...]:
    """Names and descriptions of everything of ours that Blender registers."""
    kinds: list[Any] = [*map(bpy.types.__dict__.get, dir(bpy.types)), *_below(bpy.types.bpy_struct)]
    ours = [kind for kind in kinds if (getattr(kind, "__module__", None) or "").startswith("addon.")]
    texts = dict.fromkeys(getattr(kind, "bl_label", "") for kind in ours)
    for kind in ours:
        rna = kind.bl_rna
        texts.update(dict.fromkeys((rna.name, rna.description, *_properties(rna))))
    for name in dir(bpy.ops.virtual_aperture):
        rna = getattr(bpy.ops.virtual_aperture, name).get_rna_type()
        texts.update(dict.fromkeys((rna.name, rna.description, *_properties(rna))))
    return tuple(text for text in texts if text)


def _below(kind: type) -> Iterator[type]:
    for each in kind.__subclasses__():
        yield each
        yield from _below(each)


def _properties(rna: bpy.types.Struct) -> Iterator[str]:
    of_blender = set(rna.base.properties.keys()) if rna.base is not None else set()
    for each in rna.properties:
        if each.identifier in of_blender:
            continue
        yield from (each.name, each.description)
        if each.type == "ENUM":
            for item in each.enum_items:
                yield from (item.name, item.description)


def written(path: Path) -> list[str]:
    """The texts in a module's code that are for reading: no docstrings of functions, no lone words."""
    tree = ast.parse(path.read_text())
    quiet = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    quiet |= {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    texts = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            texts.append(
                "".join(str(part.value) if isinstance(part, ast.Constant) else "..." for part in node.values)
            )
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in quiet:
            texts.append(node.value)
    return [text for text in texts if " " in text.strip()]


SOURCES = [path for path in sorted(Path(addon.__file__).parent.rglob("*.py")) if "shader" not in path.stem]


def test_everything_registered_is_seen(registered: None) -> None:
    assert len(shown()) > 300
    assert {"Compare", "Pick Focus", "Unordered Photos", "Zoom Lens"} <= set(shown())


def test_no_label_has_a_retired_name(registered: None) -> None:
    assert [text for text in shown() if text in RETIRED_NAMES] == []


def test_no_label_or_tooltip_has_a_retired_word(registered: None) -> None:
    assert [found for text in shown() for found in _retired(text)] == []


def test_a_tooltip_is_no_sentence_with_a_full_stop(registered: None) -> None:
    """Blender writes none behind the last sentence."""
    assert [text for text in shown() if text.endswith(".") and not text.endswith("..")] == []


def test_a_way_out_has_the_name_of_what_it_leads_to(registered: None) -> None:
    words = {word for remedy, word in REMEDIES.items() if remedy is not Remedy.FRAMES}
    assert words - set(shown()) == set()


def test_no_message_has_a_retired_word() -> None:
    texts = [(path.name, text) for path in SOURCES for text in written(path)]
    assert [(name, found) for name, text in texts for found in _retired(text)] == []
    assert [(name, text) for name, text in texts if text in RETIRED_NAMES] == []


def test_no_page_has_a_retired_name() -> None:
    for page in PAGES:
        found = re.findall(r"(?<!\*)\*([^*|]+?)\*(?!\*)", page.read_text())
        assert {" ".join(each.split()) for each in found}.isdisjoint(RETIRED_NAMES), page


def test_no_guide_has_a_retired_word() -> None:
    for page in GUIDES:
        text = re.sub(r"^```\n.*?^```", "", page.read_text(), flags=re.M | re.S)
        # Commands and files are called what they are called.
        sentences = re.split(r"(?<=[.:;|])\s", " ".join(re.sub(r"`[^`]+`", "", text).split()))
        assert [found for each in sentences for found in _retired(each)] == [], page


def table_of_messages(*options: str) -> list[str]:
    """Rows of the table of messages."""
    command = [sys.executable, str(ROOT / "tools/messages.py"), *options]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def test_messages_in_panels_are_short() -> None:
    table = table_of_messages("--longer", "90")
    assert any(line.startswith("| error |") for line in table)
    assert [line for line in table if line.startswith("| panel")] == []


BRITISH = re.compile(r"\b(colour|grey|centre|(milli)?metre)s?\b|isation\b|\b(recogn|stabil|organ)ised\b")


def test_labels_and_messages_are_spelled_as_blenders(registered: None) -> None:
    texts = [line.rpartition(" | ")[0] for line in table_of_messages()]
    assert len(texts) > 300
    assert [text for text in (*shown(), *texts) if BRITISH.search(text.lower())] == []
