"""What the walks of CONTRIBUTING.md name is all that an addition touches: the files that know an example."""

from __future__ import annotations

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
ADDON = ROOT / "addon"
ACTS = {
    "fill_border": {"core/frame/effects.py"},
}
"""By example, where else it is read because it acts there: any option has such a place."""


def walks() -> list[tuple[str, str, set[str]]]:
    """What is added, the example, and the files that the table names."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    rows = re.findall(r"^\| (an? [^|]+) \| ([^|]+) \| `([^|`]+)` \|$", text, re.M)
    return [(what, example, set(re.findall(r"`([^`]+)`", files))) for what, files, example in rows]


def knowing(name: str) -> set[str]:
    """Files of the add-on with a name among their tokens, those of panels and presets aside."""
    found = set()
    for path in ADDON.rglob("*.py"):
        relative = path.relative_to(ADDON).as_posix()
        if relative.startswith(("ui/panels/", "presets/")):
            continue
        tokens = tokenize.generate_tokens(io.StringIO(path.read_text()).readline)
        if any(token.type == tokenize.NAME and token.string == name for token in tokens):
            found.add(relative)
    return found


def test_there_are_six_walks() -> None:
    assert len(walks()) == 6


@pytest.mark.parametrize(("what", "example", "files"), walks())
def test_an_addition_touches_what_its_walk_names(what: str, example: str, files: set[str]) -> None:
    assert all((ADDON / file).is_file() for file in files)
    assert len(files) <= 2, what
    own = {file for file in files if Path(file).stem == example}
    assert knowing(example) | own == files | ACTS.get(example, set())
