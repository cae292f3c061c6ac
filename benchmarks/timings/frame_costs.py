"""What a frame costs by stage, read to written file: `python -m benchmarks.special frame_costs`.

Consecutive frames of a sample scene with its true cameras, as it is and enlarged, go through the shipping
code (Blender's render of our engine into PNG files) with their depth kept: it is found before, and timed
apart. Each stage's seconds are its own, without those of the stages that it calls. The clip is short, so what
is read and found of neighbours once for many frames is over when the measured ones begin.
"""

from __future__ import annotations

import argparse
import cProfile
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from unittest import mock

import bpy
import cv2
import numpy as np

import addon
from addon.core.camera.reconstruction import Reconstruction
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.depth.temporal_fusion import TemporalFusion
from addon.core.focus.focus import Focus
from addon.core.frame import frame as lens_frame
from addon.core.frame import frame_path
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlight_discs import HighlightDiscs
from addon.core.frame.meshers import layers
from addon.core.media.clip import Footage, open_footage
from addon.core.subjects.clip_subjects import ClipSubject
from addon.core.warp import layered_mesh
from addon.core.warp.disocclusion_fill import ReprojectedColours
from addon.render import engine
from addon.render.output import output
from addon.render.views import gpu_views
from addon.render.views.quiet import quiet
from addon.scene.build import build
from addon.scene.focus.focus_marks import set_focus
from addon.scene.sources.shot import Filmed, Shot, shot_of

from .. import store
from ..accuracy.cases import GroundTruth
from ..accuracy.scenes import Staged
from ..cost import Cost, cpu_seconds, measured

NOISE = 0.02
"""Of the benchmark's truths: the scene's files are those of `make bench`."""
SIZES = ("640x360", "1920x1080")
DISC = 0.05
"""Of the width: the largest disc, 32 pixels at 640x360 and 96 at 1920x1080."""
REST = "Blender, writing, reading back"
STAGES: tuple[tuple[object, str, str], ...] = (
    (engine, "render_frame", "rest of the frame"),
    (Filmed, "read", "read"),
    (ClipContext, "picture", "read, highlights"),
    (frame_path, "open_frame", "read"),
    (ClipContext, "depth", "depth, kept, for every pixel"),
    (ClipSubject, "share", "subjects"),
    (ClipContext, "hidden_colours", "hidden colours, other frames"),
    (ReprojectedColours, "colours", "hidden colours, places"),
    (layers, "layer_mesh", "mesh, rest"),
    (layered_mesh, "depth_peel", "layers"),
    (layered_mesh, "triangulated", "triangles"),
    (layered_mesh, "_mesh", "triangles"),
    (layered_mesh, "_refined", "texture"),
    (lens_frame, "prefilter", "prefilter of the texture"),
    (frame_path, "mean_of_views", "views"),
    (gpu_views, "upload", "upload"),
    (gpu_views, "_download", "download"),
    (HighlightDiscs, "light", "highlights' discs"),
)
"""Functions that are called by the thread that renders, and the stage that their time belongs to."""


@dataclass
class Stages:
    """Seconds by stage, of which one is under way at any time."""

    cpu: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    wall: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    _under_way: list[str] = field(default_factory=lambda: [REST])
    _since: tuple[float, float] = field(default_factory=lambda: (cpu_seconds(), time.perf_counter()))

    def turn(self) -> None:
        """Count what passed since the last turn for the stage that is under way."""
        now = cpu_seconds(), time.perf_counter()
        for spent, new, old in zip((self.cpu, self.wall), now, self._since, strict=True):
            spent[self._under_way[-1]] += new - old
        self._since = now

    def timed[**P, R](self, stage: str, function: Callable[P, R]) -> Callable[P, R]:
        """The function, whose time is that of a stage."""

        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            self.turn()
            self._under_way.append(stage)
            try:
                return function(*args, **kwargs)
            finally:
                self.turn()
                self._under_way.pop()

        return call

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Time all of `STAGES` within."""
        with ExitStack() as stack:
            for owner, name, stage in STAGES:
                timed = self.timed(stage, getattr(owner, name))
                stack.enter_context(mock.patch.object(owner, name, _method(timed)))
            self._since = cpu_seconds(), time.perf_counter()
            yield
            self.turn()


def _method[**P, R](function: Callable[P, R]) -> Callable[P, R]:
    """A plain function, which becomes a method where it is put into a class."""
    return lambda *args, **kwargs: function(*args, **kwargs)


@dataclass(frozen=True)
class KeptDepth:
    """Stands for `TemporalFusion` where the depth of frames was found before."""

    found: dict[int, DenseDepth]
    fusion: TemporalFusion
    """That finds what is asked of other frames."""

    def at(self, frame: int) -> DenseDepth:
        """The depth of a frame."""
        return self.found.get(frame) or self.fusion.at(frame)


def enlarged(scene: Staged, size: tuple[int, int]) -> Footage:
    """The scene's clip at a size, (width, height)."""
    clip = open_footage(scene.clip())
    if (clip.width, clip.height) == size:
        return clip
    folder = store.FOLDER / "frame_costs" / f"{scene.folder}-{scene.key}-{size[0]}x{size[1]}"
    folder.mkdir(parents=True, exist_ok=True)
    for frame in clip.frames:
        path = folder / f"frame_{frame:04d}.png"
        if not path.exists():
            picture = cv2.resize(clip.read(frame)[..., :3], size, interpolation=cv2.INTER_CUBIC)
            cv2.imwrite(str(path), picture[..., ::-1])
    return open_footage(folder)


def featured(scene: Staged, size: tuple[int, int]) -> Reconstruction:
    """The true cameras for pictures of a size, with the corners found in the judged frames."""
    true = GroundTruth(scene).reconstruction(scene.judged(0))
    zoom = size[0] / true.cameras[0].width
    images = tuple(replace(image, xy=zoom * image.xy) for image in true.images)
    return replace(true, cameras=(true.cameras[0].scaled(*size),), images=images)


def set_up(scene: Staged, size: tuple[int, int], views: int) -> bpy.types.Scene:
    """A Blender scene that shows the clip through a lens whose largest disc is `DISC` of the width."""
    made = bpy.context.scene
    reconstruction = featured(scene, size)
    settings = build(made, enlarged(scene, size), reconstruction)
    middle = scene.judged(0)[0]
    focus = scene.focus_depth(middle, 0)
    contrast = np.abs(1 / scene.depth(middle) - 1 / focus).max()
    set_focus(settings, Focus(distance=focus), middle)
    settings.views = views
    settings.aperture_radius = DISC * size[0] / (2 * reconstruction.cameras[0].fx * contrast)
    return made


def find_depth(shot: Shot, frames: list[int]) -> tuple[KeptDepth, list[Cost]]:
    """The depth of frames, and what each cost."""
    alone = ClipContext(shot.reconstruction, shot.footage.read)
    found = [measured(lambda frame=frame: alone.stereo.at(frame)) for frame in frames]  # type: ignore[misc]
    depths = dict(zip(frames, (depth for depth, _ in found), strict=True))
    return KeptDepth(depths, alone.stereo), [cost for _, cost in found]


def table(scene: Staged, size: tuple[int, int], count: int, views: int, profile: Path | None) -> str:
    """Markdown: the stages of a frame at a size, and its memory."""
    made = set_up(scene, size, views)
    shot = shot_of(made)
    middle = scene.judged(0)[0]
    frames = list(range(middle - 1, middle + count))
    found, depths = find_depth(shot, frames)
    shot.context.__dict__["stereo"] = found
    stages = Stages()
    profiler = cProfile.Profile() if profile else None

    def render(which: list[int]) -> None:
        with tempfile.TemporaryDirectory() as folder, quiet(1):
            output.render_sequence(made, which, Path(folder) / "####.png", True, lambda line: None)

    _, first = measured(lambda: render(frames[:1]))
    with stages.watching():
        if profiler:
            profiler.enable()
        _, cost = measured(lambda: render(frames[1:]))
        if profiler and profile:
            profiler.disable()
            profiler.dump_stats(profile)
    lines = [
        f"{scene.name}, {size[0]}x{size[1]}, {count} frames, {views} views, largest disc {DISC:g} of width",
        "| stage | CPU s a frame | of the frame | wall s |\n|---|---|---|---|",
    ]
    for stage in dict.fromkeys(stage for *_, stage in (*STAGES, ("", "", REST))):
        share = 100 * stages.cpu[stage] / sum(stages.cpu.values())
        wall = stages.wall[stage] / count
        lines.append(f"| {stage} | {stages.cpu[stage] / count:.3f} | {share:.0f} % | {wall:.3f} |")
    lines.append(f"| a frame, depth kept | {cost.cpu_s / count:.2f} | 100 % | {cost.wall_s / count:.2f} |")
    lines.append(f"| its first one | {first.cpu_s:.2f} | | {first.wall_s:.2f} |")
    mean = [np.mean([getattr(one, name) for one in depths[1:]]) for name in ("cpu_s", "wall_s")]
    lines.append(f"| depth, if it is to be found | {mean[0]:.2f} | | {mean[1]:.2f} |")
    lines.append(f"| peak memory with depth kept: {max(first.peak_mb, cost.peak_mb):.0f} MB")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--scene", default="bars")
    parser.add_argument("--sizes", nargs="*", default=SIZES, help="as 640x360")
    parser.add_argument("--frames", type=int, default=6, help="consecutive ones, after a first one")
    parser.add_argument("--views", type=int, default=24)
    parser.add_argument("--profile", type=Path, help="file for cProfile's statistics, of the last size")
    options = parser.parse_args()
    addon.register()
    scene = Staged(options.scene, NOISE)
    for text in options.sizes:
        width, height = map(int, text.split("x"))
        print(table(scene, (width, height), options.frames, options.views, options.profile), flush=True)


if __name__ == "__main__":
    main()
