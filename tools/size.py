"""Sizes of the add-on: lines by kind and room, constants, fields of internal options, and samples to read.

`python tools/size.py [CHECKOUT] [--sample N] [--seed N]`; run it on two checkouts to compare them.
"""

from __future__ import annotations

import argparse
import ast
import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

KINDS = ("code", "doc", "comment", "import", "blank")


def main() -> None:
    """Print the sizes of a checkout."""
    parser = argparse.ArgumentParser()
    parser.add_argument("checkout", nargs="?", type=Path, default=Path(__file__).parents[1])
    parser.add_argument("--sample", type=int, default=0, help="functions and constants to print")
    parser.add_argument("--seed", type=int, default=46)
    arguments = parser.parse_args()
    addon = arguments.checkout / "addon"
    files = {path: path.read_text() for path in sorted(addon.rglob("*.py"))}
    rooms: dict[str, Counter[str]] = {}
    constants: list[tuple[str, str, int]] = []
    fields = 0
    for path, text in files.items():
        parts = path.relative_to(addon).parts
        room = "/".join(parts[:2]) if parts[0] == "core" else parts[0]
        rooms.setdefault(room, Counter()).update(lines_by_kind(text) | {"files": 1})
        if parts[0] == "core":
            found = list(numbers(ast.parse(text), text))
            constants += [
                (f"{path.relative_to(addon)}:{line}", source, count) for line, source, count in found
            ]
            fields += option_fields(ast.parse(text))
    print("| room | files | lines | " + " | ".join(KINDS) + " |\n|---" + "|---" * 7 + "|")
    total = sum(rooms.values(), Counter())
    for room, count in [*sorted(rooms.items()), ("all", total)]:
        cells = [room, count["files"], sum(count[kind] for kind in KINDS), *(count[kind] for kind in KINDS)]
        print("| " + " | ".join(map(str, cells)) + " |")
    print(f"constants of core: {sum(count for *_, count in constants)}; fields of internal options: {fields}")
    chosen = random.Random(arguments.seed)
    for place, source, _ in sorted(chosen.sample(constants, min(arguments.sample, len(constants)))):
        print(f"\n{place}\n{source}")
    functions = [
        (f"{path.relative_to(addon)}:{node.lineno}", header(node))
        for path, text in files.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and ast.get_docstring(node)
    ]
    for place, source in sorted(chosen.sample(functions, arguments.sample)):
        print(f"\n{place}\n{source}")


def lines_by_kind(text: str) -> dict[str, int]:
    """Count the lines of a module by kind."""
    docs: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            docs |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    count = Counter[str]()
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.strip()
        kind = "doc" if number in docs else "blank" if not bare else "comment" if bare[0] == "#" else "code"
        count["import" if kind == "code" and line.startswith(("from ", "import ")) else kind] += 1
    return dict(count)


def numbers(module: ast.Module, text: str) -> Iterator[tuple[int, str, int]]:
    """Yield line, source with docstring, and count of numbers of all constants of a module."""
    for body in [module.body, *(node.body for node in module.body if isinstance(node, ast.ClassDef))]:
        for node, after in zip(body, [*body[1:], None], strict=True):
            if (
                isinstance(node, ast.Assign | ast.AnnAssign)
                and node.value
                and (count := _numbers(node.value))
            ):
                documented = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
                last = after if documented and after is not None else node
                source = "\n".join(text.splitlines()[node.lineno - 1 : last.end_lineno])
                yield node.lineno, source, count


def option_fields(module: ast.Module) -> int:
    """Count the fields of classes of internal options."""
    return sum(
        isinstance(field, ast.AnnAssign)
        for node in module.body
        if isinstance(node, ast.ClassDef) and node.name.endswith("Options") and node.name != "FrameOptions"
        for field in node.body
    )


def header(node: ast.FunctionDef) -> str:
    """Return a function's signature and docstring."""
    bare = ast.FunctionDef(
        node.name, node.args, node.body[:1], [], node.returns, None, type_params=node.type_params
    )
    return ast.unparse(ast.fix_missing_locations(ast.copy_location(bare, node)))


def _numbers(node: ast.expr) -> int:
    if isinstance(node, ast.Tuple | ast.List):
        counts = [_numbers(each) for each in node.elts]
        return sum(counts) if all(counts) else 0
    if isinstance(node, ast.BinOp):
        return int(bool(_numbers(node.left) and _numbers(node.right)))
    if isinstance(node, ast.UnaryOp):
        return _numbers(node.operand)
    return int(isinstance(node, ast.Constant) and type(node.value) in (int, float))


if __name__ == "__main__":
    main()
