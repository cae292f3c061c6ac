"""List every message of the interface and the command line as a table, with its length.

    python tools/messages.py [--longer N]

The texts are those of errors, reports, polls, labels and wrapped lines in the source; values are shown as an
ellipsis. Texts of panels are at most 90 characters long (tests/ui/test_language.py).
"""

from __future__ import annotations

import argparse
import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ADDON = Path(__file__).resolve().parents[1] / "addon"
KINDS = {
    "UserError": "error", "UsageError": "error", "report": "report", "is_met": "panel", "requires": "panel",
    "label": "panel", "poll_message_set": "panel", "wrapped": "panel", "Notice": "panel",
}  # fmt: skip
"""Functions that take messages, and where these are shown."""


@dataclass(frozen=True)
class Message:
    """A message in the source."""

    kind: str
    place: str
    """File and line."""
    text: str


def messages() -> Iterator[Message]:
    """Return all messages, in the order of files and lines."""
    for path in sorted(ADDON.rglob("*.py")):
        tree = ast.parse(path.read_text())
        names = {
            target.id: node.value
            for node in tree.body
            if isinstance(node, ast.Assign)
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        for call in (node for node in ast.walk(tree) if isinstance(node, ast.Call)):
            kind = KINDS.get(ast.unparse(call.func).rpartition(".")[2])
            for argument in (*call.args, *(word.value for word in call.keywords)) if kind else ():
                text = _text(names.get(argument.id, argument) if isinstance(argument, ast.Name) else argument)
                if kind and " " in text:
                    yield Message(kind, f"{path.relative_to(ADDON)}:{call.lineno}", text)


def _text(node: ast.expr) -> str:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part) if isinstance(part, ast.Constant) else "…" for part in node.values)
    return ""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--longer", type=int, default=0, help="only messages of more characters")
    options = parser.parse_args()
    print("| shown as | length | message | file |\n|---|---|---|---|")
    for each in messages():
        if len(each.text) > options.longer:
            print(f"| {each.kind} | {len(each.text)} | {each.text} | `{each.place}` |")


if __name__ == "__main__":
    main()
