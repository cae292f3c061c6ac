"""Docstrings and comments of the code are plain English; ruff's rules `D` check their form."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CODE = ROOT / "addon"

BANNED = {
    r"\bby eye\b": "how the value was measured",
    r"\bof that\b": "the noun",
    r"(?i)\bwho(ever)?\b": "a person or a part of the program",
    r"\b(tell|tells|told|telling)\b": "show, give, define, report",
    r"\b(say|says|said)\b": "state, give, report",
    r"(?i)(^|[.;:] )what\b": "a noun: 'moving pixels', not 'what moves'",
    r"\b(of|in|by|from|to|with|for|on|than|and|but|is|are|at|before|after) what\b": "a noun",
    r"(^|[.;] )Of\b": "a subject and a verb",
    r"(^|[.;] )(Where|Whether)\b[^,]*\.?$": "a main clause",
    r"\b(it|they) (is|are|was|were) \w+, else\b": "a whole sentence",
    r"\bso long as\b|\bas good as\b|\bat all\b|\bof its own\b": "shorter words",
    r"\bif need be\b|\bfor certain\b": "if necessary, certainly",
}
"""Patterns of constructions that a new reader stumbles over, and their replacement."""


def prose(path: Path) -> Iterator[str]:
    """Yield each docstring, documented constant and comment of a module, on one line."""
    text = path.read_text()
    for node in ast.walk(ast.parse(text)):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            # Quoted names and messages keep their own words.
            quiet = re.sub(r"`[^`]*`|\"[^\"]*\"|'[^']* [^']*'", "x", node.value.value)
            for paragraph in re.split(r"\n\s*\n|\n(?=\s*\w[\w ,*]*: )", quiet):
                # An argument's own name may be any word.
                yield " ".join(re.sub(r"^\s*\w+: ", "", paragraph).split())
    comments = [
        token.string.lstrip("# ")
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type == tokenize.COMMENT
    ]
    yield from (each for each in comments if not each.startswith(("type:", "noqa", "fmt:")))


def banned(text: str) -> list[str]:
    """Return each banned construction of a text with its replacement."""
    return [f"{found[0]!r} in {text!r}: {better}"
            for pattern, better in BANNED.items() if (found := re.search(pattern, text))]  # fmt: skip


FILES = [path for path in sorted(CODE.rglob("*.py")) if not path.is_relative_to(CODE / "presets")]


def test_docstrings_and_comments_are_plain_english() -> None:
    found = [
        (str(path.relative_to(CODE)), each) for path in FILES for text in prose(path) for each in banned(text)
    ]
    assert found == []
