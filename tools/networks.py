"""Fetch the networks that recognise people, faces and animals into `addon/networks`.

    python tools/networks.py [--out addon/networks]

They come from MediaPipe's wheel (Apache-2.0), which holds them as TensorFlow Lite models. The wheel is
checked by its SHA-256. OpenCV reads three models as they are; two are converted to ONNX. They never enter the
repository. Where the package index cannot be reached, the extension is built without them and reports so
where it would use them.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "addon" / "networks"
WHEEL = "mediapipe==0.10.21"
"""Later versions of the package hold no models."""
SHA256 = "956eb1ebc275c629e61b085b2cab89c3a5b9e93bad1bb107348d98dafb5a4bb5"
"""Of the wheel for Linux and Python 3.12, whose models are those of all platforms."""
MODELS = (
    "selfie_segmentation/selfie_segmentation.tflite",
    "selfie_segmentation/selfie_segmentation_landscape.tflite",
    "pose_landmark/pose_landmark_full.tflite",
)
CONVERTED = (
    "pose_detection/pose_detection.tflite",
    "face_detection/face_detection_full_range_sparse.tflite",
)
NOTICE = """The networks in this folder are part of MediaPipe 0.10.21
(https://github.com/google-ai-edge/mediapipe), Copyright The MediaPipe Authors, under the Apache License 2.0
(LICENSE.txt). The files that end in .onnx were converted from TensorFlow Lite: sparse weights were stored
dense, nothing else was changed.
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT)
    out: Path = parser.parse_args().out
    wanted = names()
    if all((out / name).is_file() for name in wanted):
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        wheel = download(Path(scratch))
        if wheel is None:
            print(f"people will not be recognised: {WHEEL} could not be downloaded", file=sys.stderr)
            return 0
        if hashlib.sha256(wheel.read_bytes()).hexdigest() != SHA256:
            print(f"error: {wheel.name} is not the file that was pinned by its SHA-256", file=sys.stderr)
            return 1
        fill(Path(scratch) / "networks", wheel)
        replace(out, Path(scratch) / "networks")
    print(f"{len(wanted)} networks in {os.path.relpath(out)}")
    return 0


def names() -> tuple[str, ...]:
    """Return the names of the files that the extension loads."""
    return (
        *(Path(model).name for model in MODELS),
        *(Path(model).with_suffix(".onnx").name for model in CONVERTED),
    )


def download(folder: Path) -> Path | None:
    """Download the wheel; None where the index cannot be reached or does not have it."""
    done = subprocess.run(
        [
            sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--only-binary=:all:",
            "--implementation", "cp", "--python-version", "3.12", "--platform", "manylinux_2_28_x86_64",
            "-d", str(folder), WHEEL,
        ],
        capture_output=True, check=False,
    )  # fmt: skip
    return None if done.returncode else next(folder.glob("*.whl"), None)


def replace(folder: Path, new: Path) -> None:
    """Put a new folder in the place of one, whole or not at all."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}-") as beside:
        shutil.copytree(new, Path(beside) / "new")
        if folder.exists():
            folder.rename(Path(beside) / "old")
        (Path(beside) / "new").rename(folder)


def fill(folder: Path, wheel: Path) -> None:
    """Write the models, their licence and a notice into a new folder."""
    from tflite_to_onnx import convert

    folder.mkdir()
    with zipfile.ZipFile(wheel) as archive:
        licence = next(name for name in archive.namelist() if name.endswith(".dist-info/LICENSE"))
        (folder / "LICENSE.txt").write_bytes(archive.read(licence))
        (folder / "NOTICE.txt").write_text(NOTICE)
        for model in MODELS:
            (folder / Path(model).name).write_bytes(archive.read(f"mediapipe/modules/{model}"))
        for model in CONVERTED:
            made = convert(archive.read(f"mediapipe/modules/{model}"))
            (folder / Path(model).with_suffix(".onnx").name).write_bytes(made)


if __name__ == "__main__":
    sys.exit(main())
