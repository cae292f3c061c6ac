"""The keep rule: what a constant or a pass of `addon/core` is worth, in dB on scenes of the benchmark.

`python -m benchmarks.special keep_rule --scenes pause walk --inspected depth.map_fusion` halves and doubles
each constant of a module that was chosen by inspection. `--set depth.map_fusion.JUMP=2,8` tries values, and
`--without depth.map_fusion.without_speckles:inverse` a function that returns one of its parameters. Depth and
cameras come from the video alone (T2). Values bound when a module is loaded, such as default arguments, are
not reached.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import inspect
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

from addon.core.base.limits import ONE_THREAD
from addon.core.frame.quality import NORMAL
from sample_scenes import filming

from .. import store
from . import methods
from .cases import FromVideo
from .judge import Judge
from .scenes import Short

CORE = "addon.core."
VIEWS, BLUR = 24, 24
"""Views, and pixels of the largest disc."""


def main() -> None:
    """Print a table of differences to the code as it is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", required=True, choices=filming.STAGES)
    parser.add_argument("--frames", type=int, default=1, help="judged frames of each scene")
    parser.add_argument("--inspected", nargs="*", default=(), metavar="MODULE")
    parser.add_argument("--set", nargs="*", default=(), metavar="MODULE.NAME=VALUE[,VALUE]")
    parser.add_argument("--without", nargs="*", default=(), metavar="MODULE.FUNCTION:PARAMETER")
    parser.add_argument("--job", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.job is not None:
        change(options.job)
        print(json.dumps({name: figures(name, options.frames) for name in options.scenes}))
        return
    given = [f"{name}={value}" for name, _, values in (each.partition("=") for each in options.set)
             for value in values.split(",")]  # fmt: skip
    variants = [*given, *options.without, *(each for name in options.inspected for each in inspected(name))]
    before = run("", options)
    if not before:
        sys.exit("the code as it is cannot be measured on these scenes; the reason stands above")
    print("| variant | " + " | ".join(f"{name} {before[name]:.2f} dB" for name in before) + " |")
    print("|---" * (len(before) + 1) + "|")
    with ThreadPoolExecutor(2) as pool:
        for variant, found in zip(variants, pool.map(lambda each: run(each, options), variants), strict=True):
            cells = [f"{found[name] - before[name]:+.2f}" if name in found else "fails" for name in before]
            print(f"| {variant} | " + " | ".join(cells) + " |", flush=True)


def run(variant: str, options: argparse.Namespace) -> dict[str, float]:
    """Return dB by scene, measured in a process of its own; empty if that fails."""
    words = ["--scenes", *options.scenes, "--frames", str(options.frames), "--job", variant]
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.special", "keep_rule", *words], cwd=store.ROOT,
        env={**os.environ, **ONE_THREAD, "OPENBLAS_NUM_THREADS": "1"}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    if done.returncode:
        print(f"{variant}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
        return {}
    found = json.loads(done.stdout.splitlines()[-1])
    assert isinstance(found, dict)
    return found


def figures(name: str, frames: int) -> float | None:
    """Return the mean dB of a scene's first judged frames."""
    judge = Judge(Short(name), BLUR, frames)
    with tempfile.TemporaryDirectory() as folder:
        given, _ = FromVideo(judge.scene).with_depth(NORMAL, Path(folder), judge.frames[-1])
        methods.by_mesher("layers", given.case(judge.frames[0], judge.blur), 1)
        return judge.row("T2", given, "layers", VIEWS).psnr


def inspected(name: str) -> Iterator[str]:
    """Yield the variants of a module's constants that were chosen by inspection: half and double of each."""
    module = importlib.import_module(CORE + name)
    body = ast.parse(inspect.getsource(module)).body
    for node, after in pairwise(body):
        documented = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        if not isinstance(node, ast.Assign) or not documented or "inspection" not in ast.unparse(after):
            continue
        for target in ast.walk(node.targets[0]):
            if isinstance(target, ast.Name):
                value = getattr(module, target.id)
                yield from (f"{name}.{target.id}={scaled(value, factor)!r}" for factor in (0.5, 2.0))


def scaled(value: Any, factor: float) -> Any:
    """Return a number, or each of a tuple's, times a factor; whole numbers stay whole."""
    if isinstance(value, tuple):
        return tuple(scaled(each, factor) for each in value)
    return max(round(factor * value), 1) if isinstance(value, int) else factor * value


def change(variant: str) -> None:
    """Change a constant or a pass in each module that has it, from one argument of the command line."""
    if not variant:
        return
    place, is_value, value = variant.partition("=")
    place, _, parameter = place.partition(":")
    module, _, name = place.rpartition(".")
    definer = importlib.import_module(CORE + module)
    old = getattr(definer, name)
    new = ast.literal_eval(value) if is_value else returning(old, parameter)
    for each in [each for key, each in sys.modules.items() if key.startswith("addon.")]:
        for own in names_in(each, definer, name):
            setattr(each, own, new)


def names_in(module: ModuleType, definer: ModuleType, name: str) -> list[str]:
    """Return the names by which a module has something of another one."""
    if module is definer:
        return [name]
    nodes = ast.walk(ast.parse(inspect.getsource(module) if module.__file__ else ""))
    short = definer.__name__.rpartition(".")[2]
    return [
        alias.asname or alias.name
        for node in nodes
        if isinstance(node, ast.ImportFrom) and (node.module or "").rpartition(".")[2] == short
        for alias in node.names
        if alias.name == name
    ]


def returning(function: Callable[..., Any], parameter: str) -> Callable[..., Any]:
    """Return a function of the same parameters that returns one of them."""
    signature = inspect.signature(function)
    return lambda *args, **named: signature.bind(*args, **named).arguments[parameter]


if __name__ == "__main__":
    main()
