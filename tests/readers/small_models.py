"""A tiny model in every format that is read, and its clip."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

from .. import camera_files as cameras
from .. import foreign_models as foreign

CLIP = replace(foreign.footage(("A 1.png", "b2.png", "3.png")), frames=(0, 1, 2))


def models() -> dict[str, dict[str, bytes]]:
    """For each format the files of a model that its reader reads; tiny, because each is read so often."""
    made = foreign.world(images=3, points=6)
    names = ("a 1.png", "b2.png", "c/3.png")
    listed = "a 1.png 0 80\nb2.png\nc/3.png 0 81.5\n"
    return {
        "Bundler": {"bundle.out": foreign.bundler(made, missing=(1,)).encode(), "list.txt": listed.encode()},
        "VisualSFM": {"a.nvm": foreign.nvm(made, names, radial=0.01, origin=(48.0, 32.0)).encode()},
        "VisualSFM FixedK": {
            "a.nvm": foreign.nvm(made, names, header="NVM_V3 FixedK 80 48 80 32 0\n").encode()
        },
        "Voodoo": {"track.txt": foreign.voodoo(made, k3=0.01).encode()},
        "COLMAP text": {name: text.encode() for name, text in foreign.colmap_text(made, names).items()},
        "COLMAP binary": foreign.colmap_binary(made, names),
        **alone(),
    }


@cache
def alone() -> dict[str, dict[str, bytes]]:
    """The same of formats without points."""
    made, names = foreign.world(images=3, points=6), ("a 1.png", "b2.png", "c/3.png")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        clip = foreign.write_clip(folder / "clip")
        written = {
            "transforms.json": cameras.transforms(folder / "transforms.json", made, names),
            "camera arrays of MegaSaM": cameras.megasam(folder / "a_sgd_cvd_hr.npz", made),
            "camera arrays of Depth Anything 3": cameras.depth_anything(folder / "results.npz", made),
            "Record3D": cameras.record3d(folder / "walk.r3d", made, clip),
        }
        tables = cameras.stray(folder / "stray", made, clip)
        stray = {name: (tables / name).read_bytes() for name in ("odometry.csv", "camera_matrix.csv")}
        found = {label: {path.name: path.read_bytes()} for label, path in written.items()}
        return {**found, "Stray Scanner": stray}
