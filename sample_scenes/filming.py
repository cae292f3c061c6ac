"""A stage's clip as a camera would give it, its true cameras, and the scene as a .blend to open."""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

import bpy
import cv2
import numpy as np

if __name__ == "__main__" and not __package__:
    # Run as a file: PEP 366, so that the neighbours are imported as the package they are.
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    __package__ = "sample_scenes"

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.readers.colmap_export import write_model

from . import staging, truth
from .stage import Cameras, Stage

SUBJECTS = ("stroller", "oncoming", "pause", "beast", "crossing")
"""Stages of people and animals that move."""
STAGES = (
    *("bars", "foreground", "slope", "rack", "fence", "walk", "boxes", "blocks", "plain", "porch"),
    *SUBJECTS,
)


def load(name: str) -> Stage:
    """The stage of one of `STAGES`."""
    stage = importlib.import_module(f".{name}", __package__).stage()
    assert isinstance(stage, Stage)
    return stage


def true_cameras(cameras: Cameras) -> Reconstruction:
    """The cameras as a reconstruction without points, for COLMAP and everything that reads it."""
    camera = Intrinsics(
        cameras.width, cameras.height, cameras.focal, cameras.focal, cameras.width / 2, cameras.height / 2
    )
    nothing = np.zeros((0, 2)), np.zeros(0, np.int32)
    images = tuple(
        Image(frame, rotation, translation, *nothing)
        for frame, (rotation, translation) in enumerate(
            zip(cameras.rotation, cameras.translation, strict=True), start=1
        )
    )
    return Reconstruction(
        (camera,), images, Points(np.zeros((0, 3)), np.zeros((0, 3), np.uint8), np.zeros(0))
    )


def film_frame(
    scene: bpy.types.Scene, frame: int, folder: Path, samples: int = 16, noise: float = truth.NOISE
) -> Path:
    """Write one frame of the built scene to the folder as frame_0001.png ...; one that is there is kept."""
    name = folder / f"frame_{frame:04d}.png"
    if not name.exists():
        folder.mkdir(parents=True, exist_ok=True)
        # With one seed for all frames, Cycles' noise would stand still on the screen, and features be tracked
        # towards standing still: enough for a focal length 5 % too short in a walk straight ahead.
        picture = truth.recorded(truth.pinhole(scene, frame, samples, seed=frame), frame, noise)
        # Not .png: another process may be reading the folder as a clip.
        part = folder / f"frame_{frame:04d}.part"
        part.write_bytes(cv2.imencode(".png", picture[..., ::-1])[1].tobytes())
        part.rename(name)
    return name


def film(
    stage: Stage, scene: bpy.types.Scene, folder: Path, samples: int = 16, noise: float = truth.NOISE
) -> list[Path]:
    """Every frame of the built scene, as `film_frame`."""
    frames = range(1, len(stage.cameras) + 1)
    return [film_frame(scene, frame, folder, samples, noise) for frame in frames]


def save_blend(stage: Stage, path: Path, samples: int = 64) -> bpy.types.Scene:
    """Write a .blend with the stage as its only scene, ready to render; returns that scene."""
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    nothing = bpy.context.window.scene
    scene = staging.build(stage, samples)
    bpy.data.scenes.remove(nothing)
    path.parent.mkdir(parents=True, exist_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()))
    return scene


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scene", choices=STAGES)
    parser.add_argument("--out", type=Path, required=True, help="folder for clip, cameras and .blend")
    parser.add_argument("--samples", type=int, default=16, help="Cycles samples per pixel")
    parser.add_argument("--blend-only", action="store_true", help="save the .blend, film nothing")
    arguments = parser.parse_args()
    stage = load(arguments.scene)
    scene = save_blend(stage, arguments.out / f"{stage.name}.blend", arguments.samples)
    cameras = arguments.out / "cameras"
    cameras.mkdir(exist_ok=True)
    write_model(cameras, true_cameras(stage.cameras))
    if not arguments.blend_only:
        film(stage, scene, arguments.out / "clip", arguments.samples)
    print(f"{stage.name}: {stage.title}; see {arguments.out}")


if __name__ == "__main__":
    main()
