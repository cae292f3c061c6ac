"""The zip: valid, complete, nothing else in it, and it installs."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

INSTALL = """
import sys, bpy, addon_utils
bpy.ops.extensions.package_install_files(filepath=sys.argv[1], repo='user_default', enable_on_install=True)
name = 'bl_ext.user_default.virtual_aperture'
assert name in bpy.context.preferences.addons, list(bpy.context.preferences.addons.keys())
assert hasattr(bpy.types.Scene, 'virtual_aperture')
assert bpy.utils.preset_find('50_mm_f_slash_1.4', 'virtual_aperture/lens')
assert bpy.context.preferences.addons[name].preferences.cache_folder == ''
warnings = addon_utils._extensions_warnings_get()
assert not any('virtual_aperture' in str(item) for item in warnings.items()), warnings
for _ in range(2):
    bpy.ops.preferences.addon_disable(module=name)
    assert not hasattr(bpy.types.Scene, 'virtual_aperture')
    assert not bpy.utils.preset_paths('virtual_aperture/lens')
    bpy.ops.preferences.addon_enable(module=name)
    assert hasattr(bpy.types.Scene, 'virtual_aperture')
# In Debian's Blender, pycolmap's copy of glog meets Blender's and ends the program.
assert 'pycolmap' not in sys.modules
print('INSTALLED')
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The zip without its wheels, which are 140 MB of downloads; `make zip` adds them."""
    out = tmp_path_factory.mktemp("dist")
    subprocess.run(
        [
            sys.executable, str(ROOT / "tools" / "build_zip.py"),
            "--no-wheels", "--out", str(out), "--stage", str(out / "stage"),
        ],
        check=True,
    )  # fmt: skip
    return next(out.glob("*.zip"))


def test_the_zip_holds_the_addon_and_nothing_else(built: Path) -> None:
    names = set(zipfile.ZipFile(built).namelist())
    expected = {p.relative_to(ROOT).as_posix() for p in (ROOT / "addon").rglob("*.py")}
    expected |= {p.relative_to(ROOT).as_posix() for p in (ROOT / "addon").rglob("*.osl")}
    expected |= {p.relative_to(ROOT).as_posix() for p in (ROOT / "addon" / "networks").glob("*")}
    expected |= {"__init__.py", "blender_manifest.toml", "LICENSE", "README.md"}
    assert {n for n in names if not n.endswith("/")} == expected


def test_the_checkout_is_a_valid_extension(tmp_path: Path) -> None:
    sys.path.insert(0, str(ROOT / "tools"))
    try:
        from build_zip import builder
    finally:
        sys.path.pop(0)
    target = tmp_path / "checkout.zip"
    for arguments in (
        ["validate", str(ROOT)], ["build", "--source-dir", str(ROOT), "--output-filepath", str(target)]
    ):  # fmt: skip
        done = subprocess.run(
            [sys.executable, str(builder()), *arguments], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    unwanted = {"tests", "sample_scenes", "tools", "wheels", "build", "dist", "demo", ".venv", ".ci", ".git"}
    assert not {name.split("/")[0] for name in zipfile.ZipFile(target).namelist()} & unwanted


def test_it_installs_disables_and_enables(built: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", INSTALL, str(built)], capture_output=True, text=True, check=False,
        env=os.environ | {"BLENDER_USER_RESOURCES": str(tmp_path)}, cwd=tmp_path,
    )  # fmt: skip
    assert "INSTALLED" in done.stdout, done.stdout + done.stderr


@pytest.mark.long
def test_the_store_gets_a_zip_for_each_platform_and_their_index(tmp_path: Path) -> None:
    website = "https://example.org/docs/index.md"
    subprocess.run(
        [
            sys.executable, str(ROOT / "tools" / "build_zip.py"), "--store", "--no-wheels",
            "--website", website, "--out", str(tmp_path), "--stage", str(tmp_path / "stage"),
        ],
        check=True,
    )  # fmt: skip
    listed = json.loads((tmp_path / "index.json").read_text())["data"]
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    assert sorted(each["platforms"][0] for each in listed) == sorted(manifest["platforms"])
    for each in listed:
        archive = tmp_path / each["archive_url"]
        digest = hashlib.sha256(archive.read_bytes()).hexdigest()
        assert (each["website"], each["archive_hash"]) == (website, f"sha256:{digest}")


def test_workflows_call_make() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    called = {
        name
        for path in (ROOT / ".github" / "workflows").glob("*.yml")
        for name in re.findall(r"run: make ([a-z-]+)", path.read_text())
    }
    assert {"lint", "test", "store", "store-check"} <= called <= targets
