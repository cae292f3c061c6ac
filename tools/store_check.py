"""Check zips for what the reviewers of extensions.blender.org look for, as far as a program can.

    python tools/store_check.py [dist/store]

Prints each check with what breaks it, and what the zips hold by megabyte. With BLENDER set, that program
validates the zips, too. `tests/test_packaging.py` tests what files a zip holds, and that it installs.
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import av
import cv2
import wheel_check
from build_zip import builder
from wheel_check import Wheel

ROOT = Path(__file__).resolve().parent.parent
LARGEST = 300_000_000
"""Bytes of a zip that the platform takes: its developers' notes of May 2024."""
PAGE = re.compile(r"https://[^/]+/.*(doc|manual)", re.IGNORECASE)
ADVERTS = re.compile(
    r"donat|patreon|ko-?fi\.com|paypal|buymeacoffee|gumroad|superhive|blendermarket|artstation|discord"
    r"|facebook\.|instagram\.|twitter\.|://x\.com|youtube\.|youtu\.be|linkedin|mastodon|t\.me/",
    re.IGNORECASE,
)
NETWORK = {
    "aiohttp", "asyncio", "ftplib", "http", "httpx", "imaplib", "poplib", "requests", "smtplib", "socket",
    "socketserver", "ssl", "telnetlib", "urllib", "urllib3", "webbrowser", "websockets", "xmlrpc",
}  # fmt: skip
OTHERS = {"addon_utils", "distro", "psutil", "winreg"}
"""Modules that find other add-ons and programs."""
FINDERS = {"shutil.which", "os.startfile", "os.system", "subprocess.getoutput", "subprocess.getstatusoutput"}
"""Calls that find programs, or start them by the system's shell."""
STARTERS = {f"subprocess.{name}" for name in ("Popen", "call", "check_call", "check_output", "run")}
WORKER = "addon/core/base/worker.py"
"""The one module that starts processes, which are the add-on's own."""
INSTALLERS = {"ensurepip", "pip", "site", "sysconfig", "venv", "zipimport", "runpy"}
CODE = {"__import__", "compile", "eval", "exec"}
SCRIPT = "addon/headless.py"
"""A script for `--python`, never imported by Blender: it alone puts its package among Python's modules."""
READ = {
    "addon/headless.py": "the package that the script is in",
    "addon/cli/main.py": "files of callbacks, to know them in a traceback",
    "addon/core/base/digest.py": "the code's own digest",
    "addon/core/sfm/process.py": "the package, for the solving process",
    "addon/core/subjects/networks.py": "the networks beside the code",
    "addon/render/processes/launcher.py": "the script that a process starts with",
    "addon/ui/focus/lens_presets.py": "the presets beside the code",
}
"""Files with `__file__`, and their reason: nothing is written there."""
SOURCES = (".md", ".onnx", ".py", ".tflite", ".toml", ".txt", ".whl")
ICON, FEATURED = ("icon.png", 256, 256), ("featured.jpg", 1920, 1080)
"""Pictures that the platform asks for: names, and pixels across and down."""
VIDEO, SECONDS = "video.mp4", (18.0, 22.0)
"""The video that the platform's reviewers ask for, and how long it may last."""


@dataclass(frozen=True)
class Package:
    """An extension's zip, and the folder of the pictures for the platform."""

    path: Path
    pictures: Path = ROOT / "docs" / "store"

    @cached_property
    def files(self) -> dict[str, bytes]:
        with zipfile.ZipFile(self.path) as archive:
            return {each.filename: archive.read(each) for each in archive.infolist() if not each.is_dir()}

    @cached_property
    def manifest(self) -> dict[str, Any]:
        return tomllib.loads(self.files["blender_manifest.toml"].decode())

    @cached_property
    def texts(self) -> dict[str, str]:
        """Texts for people, licences left out, by name."""
        kinds = (".md", ".py", ".toml")
        return {name: data.decode() for name, data in self.files.items() if name.endswith(kinds)}

    @cached_property
    def modules(self) -> dict[str, ast.Module]:
        return {name: ast.parse(text) for name, text in self.texts.items() if name.endswith(".py")}

    @cached_property
    def wheels(self) -> list[Wheel]:
        return [Wheel(Path(name).name, data) for name, data in self.files.items() if name.endswith(".whl")]

    def nodes(self, *kinds: type[ast.AST]) -> Iterator[tuple[str, Any]]:
        """Yield the place (file:line) and node of each node of some kinds."""
        for name, module in self.modules.items():
            for node in ast.walk(module):
                if isinstance(node, kinds):
                    yield f"{name}:{getattr(node, 'lineno', 0)}", node

    def imports(self, names: set[str]) -> Iterator[str]:
        """Yield the places that import modules of these names, or others below them."""
        for place, node in self.nodes(ast.Import):
            yield from (f"{place} imports {a.name}" for a in node.names if a.name.split(".")[0] in names)
        for place, node in self.nodes(ast.ImportFrom):
            if not node.level and (node.module or "").split(".")[0] in names:
                yield f"{place} imports {node.module}"

    def calls(self, names: set[str]) -> Iterator[str]:
        """Yield the places that call functions of these names."""
        for place, node in self.nodes(ast.Call):
            if (name := ast.unparse(node.func)) in names:
                yield f"{place} calls {name}"


def valid(package: Package) -> Iterator[str]:
    """Blender takes the manifest: tagline and reasons of 64 characters at most, without a full stop"""
    commands = [[sys.executable, str(builder())]]
    if program := os.environ.get("BLENDER"):
        commands.append([program, "--command", "extension"])
    for command in commands:
        done = subprocess.run(
            [*command, "validate", str(package.path)], capture_output=True, text=True, check=False
        )
        if done.returncode:
            yield (done.stdout + done.stderr).strip().splitlines()[-1]


def permissions(package: Package) -> Iterator[str]:
    """The one permission is files, with its reason in words"""
    asked = package.manifest.get("permissions", {})
    if set(asked) != {"files"}:
        yield f"permissions: {', '.join(asked) or 'none'}"
    yield from (f"{name}: {why!r} is no reason" for name, why in asked.items() if len(why.split()) < 3)


def website(package: Package) -> Iterator[str]:
    """The website is the documentation"""
    address = package.manifest.get("website", "")
    if not PAGE.match(address):
        yield f"website {address!r}; make store WEBSITE=URL"


def licence(package: Package) -> Iterator[str]:
    """The add-on is under the GPL 3 or later, its networks under a compatible licence, with their texts"""
    if package.manifest.get("license") != ["SPDX:GPL-3.0-or-later"]:
        yield f"licence {package.manifest.get('license')}"
    if b"GNU GENERAL PUBLIC LICENSE" not in package.files.get("LICENSE", b""):
        yield "LICENSE is not the GPL"
    networks = {str(Path(name).parent) for name in package.files if name.endswith((".onnx", ".tflite"))}
    for folder in sorted(networks):
        text = package.files.get(f"{folder}/LICENSE.txt", b"").decode()
        if not wheel_check.COMPATIBLE.search(text) or f"{folder}/NOTICE.txt" not in package.files:
            yield f"{folder}: has no compatible LICENSE.txt, or no NOTICE.txt"


def adverts(package: Package) -> Iterator[str]:
    """No donations, shops or social networks"""
    for name, text in package.texts.items():
        yield from (f"{name}: {found[0]}" for found in ADVERTS.finditer(text))


def network(package: Package) -> Iterator[str]:
    """No module of the network"""
    yield from package.imports(NETWORK)


def others(package: Package) -> Iterator[str]:
    """No updater, and nothing finds, starts or changes other add-ons and programs"""
    yield from package.imports(OTHERS)
    yield from package.calls(FINDERS)
    yield from (place for place in package.calls(STARTERS) if not place.startswith(f"{WORKER}:"))
    for place, node in package.nodes(ast.Attribute):
        if re.search(r"\bops\.(extensions|preferences|script)\.", ast.unparse(node) + "."):
            yield f"{place} uses {ast.unparse(node)}"
    for place, node in package.nodes(ast.Call, ast.Subscript):
        if re.search(r"preferences\.addons(\[|\.)(?!get\(PACKAGE\)$)", ast.unparse(node)):
            yield f"{place} uses {ast.unparse(node)}"


def code(package: Package) -> Iterator[str]:
    """No code out of text: eval, exec, compile"""
    yield from package.calls(CODE)


def modules(package: Package) -> Iterator[str]:
    """Nothing is installed, and Python's modules and their search are left alone"""
    yield from package.imports(INSTALLERS)
    for place, node in package.nodes(ast.Constant):
        if node.value in ("pip", "ensurepip"):
            yield f"{place} names {node.value}"
    changed = r"\bsys\.(path|modules|meta_path|path_hooks)\b"
    for place, node in package.nodes(ast.Call):
        if re.match(changed + r"\.(?!get\()\w+\(", text := ast.unparse(node)):
            yield f"{place}: {text}"
    for place, node in package.nodes(ast.Assign, ast.AugAssign, ast.Delete):
        targets = [node.target] if isinstance(node, ast.AugAssign) else node.targets
        for target in targets:
            if re.match(changed, ast.unparse(target)) and not place.startswith(f"{SCRIPT}:"):
                yield f"{place}: {ast.unparse(node)}"


def own_place(package: Package) -> Iterator[str]:
    """Each use of __file__ is known, and reads"""
    for place, node in package.nodes(ast.Name, ast.Attribute):
        name = node.id if isinstance(node, ast.Name) else node.attr
        if name == "__file__" and place.split(":")[0] not in READ:
            yield place


def sources(package: Package) -> Iterator[str]:
    """Outside the wheels are sources, texts and networks: no bytecode, library or hidden file"""
    for name, data in package.files.items():
        is_hidden = any(part.startswith(".") or part == "__pycache__" for part in Path(name).parts)
        is_source = name.endswith(SOURCES) or name == "LICENSE"
        if is_hidden or not is_source or data.startswith(wheel_check.FORMATS):
            yield name
    listed = {name.removeprefix("./") for name in package.manifest.get("wheels", ())}
    there = {name for name in package.files if name.endswith(".whl")}
    yield from (f"{name} is listed or there, not both" for name in sorted(listed ^ there))


def size(package: Package) -> Iterator[str]:
    """The zip is no larger than the platform takes"""
    if (found := package.path.stat().st_size) > LARGEST:
        yield f"{found / 1e6:.1f} MB, not {LARGEST / 1e6:.0f}"


def pictures(package: Package) -> Iterator[str]:
    """There are an icon and a featured picture, of the sizes that the platform asks for"""
    for name, across, down in (ICON, FEATURED):
        picture = cv2.imread(str(package.pictures / name))
        if picture is None or picture.shape != (down, across, 3):
            yield f"{name}: is no picture of {across}x{down}"


def video(package: Package) -> Iterator[str]:
    """There is a video of about 20 seconds"""
    least, most = SECONDS
    try:
        with av.open(str(package.pictures / VIDEO)) as film:
            seconds = (film.duration or 0) / av.time_base
    except av.FFmpegError as error:
        yield f"{VIDEO}: {error.strerror}"
        return
    if not least <= seconds <= most:
        yield f"{VIDEO}: lasts {seconds:.1f} s, not {least:.0f} to {most:.0f}"


def of_wheels(check: Callable[[list[Wheel]], Iterator[str]]) -> Callable[[Package], Iterator[str]]:
    """Make a check of a package from one of its wheels."""

    def checked(package: Package) -> Iterator[str]:
        yield from check(package.wheels)

    checked.__doc__, checked.__name__ = check.__doc__, check.__name__
    return checked


def fitting(package: Package) -> Iterator[str]:
    yield from wheel_check.fitting(package.wheels, package.manifest["platforms"][0])


fitting.__doc__ = wheel_check.fitting.__doc__
CHECKS: tuple[Callable[[Package], Iterator[str]], ...] = (
    valid, permissions, website, licence, adverts, network, others, code, modules, own_place, sources,
    *(of_wheels(each) for each in
      (wheel_check.modified, wheel_check.bundled, wheel_check.licensed, wheel_check.programs)),
    fitting, size, pictures, video,
)  # fmt: skip
"""All checks; the first line of their docstring is printed."""


def megabytes(package: Package) -> list[str]:
    """Return what a zip holds, the largest first; what is compressed in it weighs as it does there."""
    parts = Counter[str]()
    with zipfile.ZipFile(package.path) as archive:
        for each in archive.infolist():
            name = each.filename
            part = name if name.endswith(".whl") else "networks" if "/networks/" in name else "code and texts"
            parts[part.removeprefix("wheels/")] += each.compress_size
    return [f"{weight / 1e6:7.2f} MB  {part}" for part, weight in parts.most_common()]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=ROOT / "dist" / "store")
    zips = sorted(parser.parse_args().folder.glob("*.zip"))
    if not zips:
        print("store-check: there are no zips; run make store WEBSITE=URL", file=sys.stderr)
        return 1
    failed = 0
    for path in zips:
        package = Package(path)
        print(f"{path.name} ({path.stat().st_size / 1e6:.1f} MB)", *megabytes(package), sep="\n")
        for check in CHECKS:
            breaches = list(check(package))
            failed += bool(breaches)
            print("  FAILS" if breaches else "  ok   ", (check.__doc__ or "").splitlines()[0])
            print(*(f"        {each}\n" for each in breaches), sep="", end="")
    print(f"{failed} checks failed" if failed else "all checks passed")
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
