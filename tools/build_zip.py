"""Build the extension's zip for one platform: stage the add-on, download its wheels, list them, build.

    python tools/build_zip.py [--platform linux-x64] [--out dist] [--stage build/stage] [--no-wheels]

Uses the builder inside the bpy wheel, which is the code behind `blender --command extension`.
"""

from __future__ import annotations

import argparse
import importlib.util
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STAGED = ("blender_manifest.toml", "__init__.py", "README.md", "LICENSE", "addon")
TAGS = {
    "linux-x64": ["manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": ["macosx_14_0_arm64", "macosx_13_0_arm64", "macosx_11_0_arm64"],
}
# Blender's own builds run Python 3.13, Debian's 3.14. PyAV's and OpenCV's wheels serve both. numpy
# comes with Blender and must never be bundled: it would win over Blender's own for every other extension.
WHEELS = {"av": ("3.13",), "pycolmap": ("3.13", "3.14"), "opencv-contrib-python-headless": ("3.13",)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--platform", choices=TAGS, default="linux-x64")
    parser.add_argument("--out", type=Path, default=ROOT / "dist")
    parser.add_argument("--stage", type=Path, default=ROOT / "build" / "stage", help="made anew")
    parser.add_argument("--no-wheels", action="store_true", help="the add-on alone, for quick checks")
    options = parser.parse_args()
    stage: Path = options.stage
    shutil.rmtree(stage, ignore_errors=True)
    stage.mkdir(parents=True)
    for name in STAGED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, stage / name, ignore=shutil.ignore_patterns("__pycache__"))
        elif source.exists():
            shutil.copy(source, stage / name)
    if not options.no_wheels:
        download(stage / "wheels", options.platform)
        list_wheels(stage, options.platform)
    manifest = tomllib.loads((stage / "blender_manifest.toml").read_text())
    options.out.mkdir(parents=True, exist_ok=True)
    target = options.out / f"{manifest['id']}-{manifest['version']}-{options.platform}.zip"
    extension("build", "--source-dir", str(stage), "--output-filepath", str(target))
    extension("validate", str(target))
    print(f"{target} ({target.stat().st_size / 1e6:.1f} MB)")
    return 0


def download(folder: Path, platform: str) -> None:
    """Wheels of the pinned versions, unmodified; kept between runs, because they are large."""
    pins = dict(
        line.split("==")
        for line in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    )
    cache = ROOT / "wheels" / platform
    tags = [part for tag in TAGS[platform] for part in ("--platform", tag)]
    for name, pythons in WHEELS.items():
        for python in pythons:
            done = subprocess.run(
                [
                    sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--only-binary=:all:",
                    "--implementation", "cp", "--python-version", python, *tags,
                    "-d", str(cache), f"{name}=={pins[name]}",
                ],
                stderr=subprocess.PIPE, text=True, check=False,
            )  # fmt: skip
            # pip warns of every local package folder that happens not to hold this package.
            said = [s for s in done.stderr.splitlines() if "is ignored: it is neither a file" not in s]
            print(*said, sep="\n", end="\n" if said else "", file=sys.stderr)
            if done.returncode:
                sys.exit(f"error: no wheel of {name} {pins[name]} for Python {python} on {platform}")
    folder.mkdir()
    for wheel in cache.glob("*.whl"):
        if any(wheel.name.startswith(f"{name.replace('-', '_')}-{pins[name]}-") for name in WHEELS):
            shutil.copy(wheel, folder)


def list_wheels(stage: Path, platform: str) -> None:
    """Write wheels and platform into the staged manifest."""
    manifest = stage / "blender_manifest.toml"
    lines = manifest.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("platforms"))
    wheels = ", ".join(f'"./wheels/{w.name}"' for w in sorted((stage / "wheels").glob("*.whl")))
    lines[at] = f'platforms = ["{platform}"]\nwheels = [{wheels}]'
    manifest.write_text("\n".join(lines) + "\n")


def extension(*arguments: str) -> None:
    """Run the extension builder that comes with bpy."""
    subprocess.run([sys.executable, str(builder()), *arguments], check=True)


def builder() -> Path:
    """The stand-alone script in bpy's folder."""
    spec = importlib.util.find_spec("bpy")
    assert spec is not None and spec.origin is not None
    found = sorted(Path(spec.origin).parent.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    return found[-1]


if __name__ == "__main__":
    sys.exit(main())
