"""Each check of `make store-check` passes a sound zip, and fails a zip that breaks it."""

from __future__ import annotations

import base64
import hashlib
import io
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tools"))
try:
    import store_check
finally:
    sys.path.pop(0)

Files = dict[str, bytes]
WHEEL = "wheels/thing-1.0-cp312-abi3-manylinux_2_28_x86_64.whl"
LIBRARY = (b"\x7fELF\x02\x01\x01".ljust(18, b"\0") + b"\x3e\0").ljust(54, b"\0") + b"\x38".ljust(66, b"\0")
"""Head of a library for Linux on x86-64: no program header, which would have 56 bytes."""
PROGRAM = bytearray(LIBRARY)
PROGRAM[32], PROGRAM[56], PROGRAM[64] = 64, 1, 3
"""Its one program header, at byte 64, names a loader."""
METADATA = b"Metadata-Version: 2.1\nName: thing\nVersion: 1.0\nLicense: MIT\nRequires-Dist: numpy>=2\n"


def wheel(changed: Files, damaged: str = "") -> bytes:
    """A wheel of a library, with other files; one of them is damaged after its digest was recorded."""
    files = {"thing/lib.so": LIBRARY, "thing-1.0.dist-info/METADATA": METADATA}
    files |= {"thing-1.0.dist-info/LICENSE": b"MIT"} | changed
    rows = [
        f"{name},sha256={base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip('=')},"
        for name, data in files.items()
    ]
    files["thing-1.0.dist-info/RECORD"] = "\n".join([*rows, "thing-1.0.dist-info/RECORD,,"]).encode()
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data + (b"!" if name == damaged else b""))
    return made.getvalue()


def sound() -> Files:
    """The files of a zip in which all is right."""
    manifest = (ROOT / "blender_manifest.toml").read_text()
    platforms = 'platforms = ["linux-x64", "windows-x64", "macos-arm64"]'
    given = (
        f'platforms = ["linux-x64"]\nwheels = ["./{WHEEL}"]\nwebsite = "https://example.org/docs/index.html"'
    )
    assert platforms in manifest
    return {
        "blender_manifest.toml": manifest.replace(platforms, given).encode(),
        "__init__.py": b"from .addon import register, unregister\n",
        "LICENSE": (ROOT / "LICENSE").read_bytes(),
        "addon/__init__.py": b"import sys\nPATHS = list(sys.path)\n",
        "addon/headless.py": b"import sys\nsys.modules['addon'] = sys\nPLACE = __file__\n",
        "addon/networks/one.onnx": b"weights",
        "addon/networks/LICENSE.txt": b"Apache License",
        "addon/networks/NOTICE.txt": b"of others",
        WHEEL: wheel({}),
    }


def package(folder: Path, files: Files) -> store_check.Package:
    """Write a zip, and the pictures and the video beside it."""
    for name, across, down in (store_check.ICON, store_check.FEATURED):
        cv2.imwrite(str(folder / name), np.zeros((down, across, 3), np.uint8))
    write_video(folder, 20)
    with zipfile.ZipFile(folder / "thing.zip", "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return store_check.Package(folder / "thing.zip", folder)


def write_video(folder: Path, seconds: int) -> None:
    film = cv2.VideoWriter(str(folder / store_check.VIDEO), cv2.VideoWriter.fourcc(*"mp4v"), 1.0, (32, 32))
    for _ in range(seconds):
        film.write(np.zeros((32, 32, 3), np.uint8))
    film.release()


def manifest(old: str, new: str) -> Callable[[Files], None]:
    """Change the manifest."""

    def change(files: Files) -> None:
        assert old.encode() in files["blender_manifest.toml"]
        files["blender_manifest.toml"] = files["blender_manifest.toml"].replace(old.encode(), new.encode())

    return change


def put(name: str, data: bytes) -> Callable[[Files], None]:
    """Add a file, or replace it."""
    return lambda files: files.update({name: data})


def source(text: str) -> Callable[[Files], None]:
    """Add a module."""
    return put("addon/more.py", text.encode())


def in_wheel(name: str, data: bytes) -> Callable[[Files], None]:
    """Add a file to the wheel, or replace it."""
    return put(WHEEL, wheel({name: data}))


FILES, TAGLINE = "Read clips, keep solves, write rendered frames", "made after it was shot"
INFORMATION = "thing-1.0.dist-info/METADATA"
BREACHES: dict[str, list[Callable[[Files], None]]] = {
    "valid": [
        manifest(TAGLINE, f"{TAGLINE}."), manifest("schema_version", "schema"),
    ],
    "permissions": [
        manifest(FILES, "Files"), manifest("files =", 'network = "Ask a server for news"\nfiles ='),
    ],
    "website": [manifest("https://example.org/docs/index.html", "https://example.org/virtual-aperture")],
    "licence": [
        manifest("GPL-3.0-or-later", "MIT"), put("LICENSE", b"MIT"),
        put("addon/networks/LICENSE.txt", b"for research only"),
        lambda files: files.pop("addon/networks/NOTICE.txt") and None,
    ],
    "adverts": [source("# Please donate")],
    "network": [source("import socket"), source("from urllib.request import urlopen")],
    "others": [
        source("import addon_utils"), source("import subprocess\nsubprocess.run(['nuke'])"),
        source("context.preferences.addons['node']"),
    ],
    "code": [source("eval('1')")],
    "modules": [
        source("import sys\nsys.path.append('here')"), source("import sys\nsys.modules['numpy'] = None"),
        source("import pip"), source("COMMAND = [python, '-m', 'pip', 'install']"),
    ],
    "own_place": [source("open(__file__, 'w')"), source("import os\nos.__file__")],
    "sources": [
        put("addon/more.pyc", b"code"), put("addon/more.py", LIBRARY),
        lambda files: files.pop(WHEEL) and None,
    ],
    "modified": [put(WHEEL, wheel({}, damaged="thing/lib.so"))],
    "bundled": [
        in_wheel("numpy/__init__.py", b""), in_wheel(INFORMATION, METADATA + b"Requires-Dist: scipy>1\n"),
    ],
    "licensed": [
        in_wheel(INFORMATION, METADATA.replace(b"MIT", b"Proprietary")),
        put(WHEEL, wheel({}).replace(b"dist-info/LICENSE", b"dist-info/READER ")),
    ],
    "programs": [
        in_wheel("thing/tool", bytes(PROGRAM)), in_wheel("thing/tool.exe", b"MZ"),
    ],
    "fitting": [
        in_wheel("thing/lib.dll", b"MZ"), in_wheel("thing/lib.so", LIBRARY.replace(b"\x3e", b"\xb7")),
        lambda files: files.update({WHEEL.replace("cp312-abi3", "cp314-cp314"): files.pop(WHEEL)}),
        lambda files: files.update({WHEEL.replace("manylinux_2_28_x86_64", "win_amd64"): files.pop(WHEEL)}),
    ],
    "size": [],
    "pictures": [],
    "video": [],
}  # fmt: skip
"""Changes that break a check, by its name; the last three are of no file in the zip."""
CHECKS = {check.__name__: check for check in store_check.CHECKS}


def test_a_sound_zip_passes(tmp_path: Path) -> None:
    there = package(tmp_path, sound())
    assert {name: list(check(there)) for name, check in CHECKS.items()} == {name: [] for name in BREACHES}


@pytest.mark.parametrize(
    ("name", "change"), [(name, change) for name, changes in BREACHES.items() for change in changes]
)
def test_a_breach_is_found(name: str, change: Callable[[Files], None], tmp_path: Path) -> None:
    files = sound()
    change(files)
    assert list(CHECKS[name](package(tmp_path, files)))


def test_a_large_zip_and_missing_pictures_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    there = package(tmp_path, sound())
    monkeypatch.setattr(store_check, "LARGEST", 1000)
    assert list(CHECKS["size"](there))
    (tmp_path / "featured.jpg").replace(tmp_path / "icon.png")
    assert len(list(CHECKS["pictures"](there))) == 2


def test_a_video_of_another_length_is_found(tmp_path: Path) -> None:
    there = package(tmp_path, sound())
    write_video(tmp_path, 17)
    assert list(CHECKS["video"](there)) == ["video.mp4: lasts 17.0 s, not 18 to 22"]
    (tmp_path / "video.mp4").unlink()
    assert list(CHECKS["video"](there)) == ["video.mp4: No such file or directory"]


def test_a_breach_ends_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["store_check.py", str(tmp_path)])
    assert store_check.main() == 1
    package(tmp_path, sound() | {"addon/more.py": b"import socket"})
    monkeypatch.setattr(store_check, "CHECKS", (store_check.network,))
    assert store_check.main() == 1
    assert "FAILS No module of the network\n        addon/more.py:1 imports socket" in capsys.readouterr().out
    package(tmp_path, sound())
    assert store_check.main() == 0
