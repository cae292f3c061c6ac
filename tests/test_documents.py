"""What the documents name is there: links, files, modules, targets of make, tests and commands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from benchmarks import quoted, store
from benchmarks.special import SPECIAL

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "Makefile"])
MADE = {".venv", "build", "dist", "demo", "sample", "shared"}
"""Folders that are not in a fresh checkout."""


def code(text: str) -> list[str]:
    """What stands in backticks or in indented or fenced blocks."""
    fenced = re.findall(r"^```\n(.*?)^```", text, re.M | re.S)
    rest = re.sub(r"^```\n.*?^```", "", text, flags=re.M | re.S)
    return [*fenced, *(" ".join(each.split()) for each in re.findall(r"`([^`]+)`", rest))]


def module_file(name: str) -> bool:
    path = ROOT.joinpath(*name.split("."))
    return path.with_suffix(".py").is_file() or (path / "__main__.py").is_file()


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_is_named_is_there(document: Path) -> None:
    text = document.read_text()
    spans = [text] if document.name == "Makefile" else code(text)
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (document.parent / link).exists(), link
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
    for span in spans:
        for target in re.findall(r"(?<!install )\bmake ([a-z-]+)", span):
            assert target in targets, f"make {target}"
        for module in re.findall(r"-m ((?:addon|benchmarks|sample_scenes)[\w.]*)", span):
            assert module_file(module), module
        for name in re.findall(r"-m benchmarks\.special (\w+)", span):
            assert name in SPECIAL or name == "NAME", f"benchmarks.special {name}"
        for path, name in re.findall(r"(tests/[\w/]*\.py)(?: -s)?(?: -k (\w+))?", span):
            assert (ROOT / path).is_file(), path
            assert not name or name == "NAME" or name in (ROOT / path).read_text(), f"{path} -k {name}"
        for path in re.findall(
            r"(?<![\w/.-])((?:addon|core|benchmarks|sample_scenes|tests|tools|docs)/[\w./]*\w)", span
        ):
            below = ROOT / "addon" if path.startswith("core/") else ROOT
            assert (below / path).exists(), path
        if re.fullmatch(r"\w+\.py", span):
            assert [path for top in ("addon", "tests") for path in (ROOT / top).rglob(span)], span


@pytest.mark.parametrize("name", quoted.DOCUMENTS)
def test_quoted_figures_are_those_of_the_results(name: str) -> None:
    """`python -m benchmarks.quoted` writes them after another run, or once the code has changed since."""
    text = (ROOT / name).read_text()
    assert quoted.BLOCK.search(text)
    assert text == quoted.up_to_date(text), "run: python -m benchmarks.quoted"


def test_quoted_figures_follow_the_results(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(quoted.QUOTED, "trackers", lambda: "28 of 28")
    document = "| <!-- quoted trackers -->27 of 28<!-- end --> | and <!-- quoted trackers --><!-- end -->"
    block = "<!-- quoted trackers -->28 of 28<!-- end -->"
    assert quoted.up_to_date(document) == f"| {block} | and {block}"
    with pytest.raises(KeyError):
        quoted.up_to_date("<!-- quoted nothing --><!-- end -->")


def test_figures_of_an_earlier_commit_are_marked() -> None:
    marks = ["b2 (2026-11-22)", "a1 (2026-11-23)", "b2 (2026-11-22)"]
    assert store.measured_at(marks, "1", "1") == "measured at b2 (2026-11-22) to a1 (2026-11-23)"
    assert store.measured_at(marks[:1], "1", "2") == "measured at b2 (2026-11-22), of an earlier commit"


def test_special_benchmarks_are_there() -> None:
    for name, (package, _) in SPECIAL.items():
        module = ROOT.joinpath(*package.split("."), f"{name}.py")
        assert "\ndef main() -> None:" in module.read_text(), name


def test_every_target_of_make_is_told() -> None:
    text = (ROOT / "Makefile").read_text()
    targets = set(re.findall(r"^\.PHONY: (.*)$", text, re.M)[0].split()) - {"help"}
    assert {target for target in targets if f'"make {target}' not in text} == set()


def test_every_page_is_in_the_site() -> None:
    listed = re.findall(r"([\w/]+\.md)$", (ROOT / "tools" / "mkdocs.yml").read_text(), re.M)
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]
    assert sorted(listed) == sorted(page.relative_to(ROOT).as_posix() for page in pages)


def test_scripts_that_make_calls_are_there() -> None:
    text = (ROOT / "Makefile").read_text() + (ROOT / ".ci" / "run").read_text()
    for path in re.findall(r"\b((?:tools|sample_scenes)/[\w-]+\.(?:py|sh|txt))", text):
        assert (ROOT / path).is_file(), path


def test_every_command_is_in_the_reference() -> None:
    documented = set(re.findall(r"^\| `(\w+) ", (ROOT / "docs" / "command_line.md").read_text(), re.M))
    named = re.findall(
        r'\.add_parser\(\s*"(\w+)"', "".join(p.read_text() for p in (ROOT / "addon" / "cli").glob("*.py"))
    )
    assert documented == set(named)
