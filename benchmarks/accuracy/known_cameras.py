"""What cameras without points are worth beside a solve with points.

`python -m benchmarks.special known_cameras [SCENE ...]` renders the judged frames of a scene at 32 px from
our solve, imported with its points; from the same poses as an animated Blender camera, without points; and
from the camera of the scene's own .blend. PSNR in dB against Cycles' thin lens, as the benchmark's T2.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import bpy

import addon
from addon.core.frame.clip_context import ClipContext
from addon.core.media.clip import open_footage
from addon.core.readers import read_reconstruction
from addon.core.readers.colmap_export import write_model
from addon.core.readers.matching import Imported
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import Solve, keep_import, load_solve
from addon.scene.solve import camera
from addon.scene.sources.scene_camera import read_scene_camera
from sample_scenes.filming import save_blend

from .cases import FromVideo
from .judge import Judge
from .scenes import Staged

BLUR, NOISE, VIEWS = 32, 0.02, 64


class FromCameras(FromVideo):
    """T2 with another reconstruction than our solve."""

    def __init__(self, scene: Staged, solve: Solve) -> None:
        self.scene, self.reconstruction, self.report = scene, solve.reconstruction, solve.report
        self.clip = ClipContext(self.reconstruction, open_footage(scene.clip()).read)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=["bars"])
    arguments = parser.parse_args()
    print("| scene | cameras | points | miss, px | reprojection, px | PSNR, dB |\n|---|---|---|---|---|---|")
    for name in arguments.scenes:
        scene = Staged(name, NOISE)
        solved = FromVideo(scene)
        with tempfile.TemporaryDirectory() as folder:
            compare(scene, solved, Path(folder))


def compare(scene: Staged, solved: FromVideo, folder: Path) -> None:
    """Print a row for each way to the same clip's cameras."""
    clip = open_footage(scene.clip())
    (folder / "model").mkdir()
    write_model(folder / "model", solved.reconstruction)
    keep_import(read_reconstruction(folder / "model", clip), clip, folder / "points")
    row(scene, "our solve, imported with points", load_solve(folder / "points"))
    row(scene, "the same as a Blender camera", placed(scene, as_blender(scene, solved), folder / "same"))
    own = save_blend(scene.stage, folder / "scene.blend")
    filmed = next(thing for thing in own.objects if thing.type == "CAMERA")
    found = read_scene_camera(own, filmed, clip)
    row(scene, "the scene's own Blender camera", placed(scene, found, folder / "own"))


def as_blender(scene: Staged, solved: FromVideo) -> Imported:
    """The solve's cameras as a Blender camera that is animated, and read from it again."""
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    made, footage = bpy.context.scene, open_footage(scene.clip())
    thing = bpy.data.objects.new("Solved", bpy.data.cameras.new("Solved"))
    made.collection.objects.link(thing)
    made.render.resolution_x, made.render.resolution_y = footage.width, footage.height
    camera.animate(thing, solved.reconstruction)
    return read_scene_camera(made, thing, footage)


def placed(scene: Staged, found: Imported, work: Path) -> Solve:
    """Cameras with the points that are found in the clip."""
    SolveProcess(scene.clip(), work, cameras=found).wait()
    return load_solve(work)


def row(scene: Staged, name: str, solve: Solve) -> None:
    """Render, judge and print."""
    score = Judge(scene, BLUR).row("T2", FromCameras(scene, solve), "layers", VIEWS)
    said, quality = solve.report, solve.quality
    miss = f"{said['camera_miss'] * max(said['size']) / 1000:.2f}" if "camera_miss" in said else ""
    assert quality.reprojection_error is not None
    words = (scene.name, name, quality.points, miss, f"{quality.reprojection_error:.2f}", f"{score.psnr:.2f}")
    print("|", " | ".join(map(str, words)), "|", flush=True)


if __name__ == "__main__":
    addon.register()
    main()
