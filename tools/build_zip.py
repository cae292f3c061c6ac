"""Build the extension's zips: stage the add-on, download its wheels, list them, build.

    python tools/build_zip.py [--platform linux-x64] [--out dist] [--stage build/stage] [--no-wheels]
    python tools/build_zip.py --store [--out dist/store]

With `--store` all platforms' zips for Blender's own builds alone, and the index with which their folder is a
repository of extensions on any web server. Uses the builder inside the bpy wheel, which is the code behind
`blender --command extension`.
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
# Blender's own builds run the first Python, Debian's, on Linux alone, the second. PyAV's and OpenCV's wheels
# serve both. numpy comes with Blender and must never be bundled: it would win over Blender's own for every
# other extension. All stay unmodified: extensions.blender.org demands it, and extensions share their wheels.
WHEELS = {"av": ("3.13",), "pycolmap": ("3.13", "3.14"), "opencv-contrib-python-headless": ("3.13",)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--platform", choices=TAGS, default="linux-x64")
    parser.add_argument("--store", action="store_true", help="all platforms, and the index of a repository")
    parser.add_argument("--website", metavar="URL", help="where the documentation is read")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--stage", type=Path, default=ROOT / "build" / "stage", help="made anew")
    parser.add_argument("--no-wheels", action="store_true", help="the add-on alone, for quick checks")
    options = parser.parse_args()
    out: Path = options.out or ROOT / "dist" / ("store" if options.store else "")
    out.mkdir(parents=True, exist_ok=True)
    if options.store:
        for old in out.glob("*.zip"):
            # The index would list it.
            old.unlink()
    for platform in TAGS if options.store else [options.platform]:
        build(platform, out, options)
    if options.store:
        extension("server-generate", "--repo-dir", str(out), "--html")
    return 0


def build(platform: str, out: Path, options: argparse.Namespace) -> None:
    """Stage, build and validate the zip of one platform."""
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
        download(stage / "wheels", platform, 1 if options.store or platform != "linux-x64" else None)
    complete_manifest(stage, platform, options.website)
    manifest = tomllib.loads((stage / "blender_manifest.toml").read_text())
    target = out / f"{manifest['id']}-{manifest['version']}-{platform}.zip"
    extension("build", "--source-dir", str(stage), "--output-filepath", str(target))
    extension("validate", str(target))
    print(f"{target} ({target.stat().st_size / 1e6:.1f} MB)")


def download(folder: Path, platform: str, count: int | None) -> None:
    """Wheels of the pinned versions for the first so many Pythons, unmodified; kept between runs, because
    they are large."""
    pins = dict(
        line.split("==")
        for line in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    )
    cache = ROOT / "wheels" / platform
    tags = [part for tag in TAGS[platform] for part in ("--platform", tag)]
    serving = {"-abi3-"}
    for name, pythons in WHEELS.items():
        serving |= {f"-cp{python.replace('.', '')}-" for python in pythons[:count]}
        for python in pythons[:count]:
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
    pinned = tuple(f"{name.replace('-', '_')}-{pins[name]}-" for name in WHEELS)
    for wheel in cache.glob("*.whl"):
        if wheel.name.startswith(pinned) and any(tag in wheel.name for tag in serving):
            shutil.copy(wheel, folder)


def complete_manifest(stage: Path, platform: str, website: str | None) -> None:
    """Write the platform, its wheels and the website, where there are any, into the staged manifest."""
    manifest = stage / "blender_manifest.toml"
    lines = manifest.read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("platforms"))
    wheels = ", ".join(f'"./wheels/{w.name}"' for w in sorted((stage / "wheels").glob("*.whl")))
    # Before the first table.
    lines[at : at + 1] = [
        f'platforms = ["{platform}"]',
        *([f"wheels = [{wheels}]"] if wheels else []),
        *([f'website = "{website}"'] if website else []),
    ]
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
