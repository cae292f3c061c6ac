"""Dense depth against the truth, beside Delaunay triangles of the sparse features' depth.

`python -m benchmarks.special dense_depth [SCENE ...] [--pictures FOLDER]`. T1: true cameras, and the
features that tracking would take with their true depth; T2: the newest kept solve of the clip. "Dense" is
what a frame's own sweep finds, "fused" what the product draws with.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from addon.core.camera.reconstruction import Points, Reconstruction
from addon.core.depth.multi_view_stereo import DenseDepth, PlaneSweepStereo
from addon.core.depth.sparse import frame_features
from addon.core.depth.temporal_fusion import TemporalFusion
from addon.core.media.clip import Footage, open_footage
from addon.core.media.light import to_gray8
from addon.core.sfm.state import STATE
from addon.core.sfm.tracking.klt import new_corners
from addon.core.sfm.workspace import load_solve

from .. import store
from .scenes import Staged

SCENES = ("bars", "foreground", "slope", "fence", "walk", "boxes", "blocks", "porch")
OFF = 0.05
"""Of the range of inverse depths, from which on a pixel is wrong."""
JUMP, BAND = 0.1, 5
"""Of that range, which makes an edge of the depth, and the pixels on either side that are counted with it."""
DEEPER = 0.08
"""Of the range of inverse depths, by which a speckle is deeper than its rim: that of a jump in
`FusionOptions.jump`."""
SPECKLE = 6
"""Pixels of a speckle at most: fewer than texture can prove."""

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Case:
    """A clip on film and what is true of it; lengths in metres."""

    name: str
    footage: Footage
    cameras: Reconstruction
    frames: tuple[int, ...]
    """With true depth, consecutive."""
    depth: Callable[[int], Floats]
    """(H, W), inf infinitely far."""
    moves: Callable[[int], Mask]
    """(H, W) what moves by itself."""
    solve: Path | None

    def known(self, frame: int) -> Reconstruction:
        """All true cameras, and the corners of one frame with their true depth."""
        image, _ = self.cameras.image_at(frame)
        camera, depth = self.cameras.intrinsics(image), self.depth(frame)
        corners = new_corners(to_gray8(self.footage.read(frame)), np.zeros((0, 2), np.float32))
        xy = corners.astype(np.float64) + 0.5
        column, row = np.clip(xy, 0, [camera.width - 1, camera.height - 1]).astype(int).T
        z = depth[row, column]
        xy, z = xy[np.isfinite(z)], z[np.isfinite(z), None]
        local = np.column_stack([(xy - camera.principal_point) / camera.focal, np.ones(len(xy))]) * z
        points = Points(
            (local - image.translation) @ image.rotation, np.zeros((len(xy), 3), np.uint8), np.zeros(len(xy))
        )
        seen = replace(image, xy=xy, points=np.arange(len(xy), dtype=np.int32))
        images = tuple(seen if one.frame == frame else one for one in self.cameras.images)
        return Reconstruction(self.cameras.cameras, images, points)


def case(name: str) -> Case:
    """A scene by its name."""
    staged = Staged(name, 0.03)
    first = len(staged.stage.cameras) // 2
    return Case(
        name, open_footage(staged.clip()), staged.cameras, (first, first + 1), staged.depth, staged.moves,
        _newest(store.FOLDER / "solves", f"{name}-{staged.key}-*"),
    )  # fmt: skip


def _newest(folder: Path, pattern: str) -> Path | None:
    found = [path for path in folder.glob(pattern) if (path / STATE).exists()]
    return max(found, key=lambda path: path.stat().st_mtime, default=None)


@dataclass(frozen=True)
class Figures:
    """Per cent; of what does not move, but for the last three."""

    median: float
    ninetieth: float
    """Percentiles of the error in inverse depth over the range of the true ones."""
    off: float
    off_at_edges: float
    """Pixels with an error above `OFF`, and of those at edges of the depth."""
    sure: float
    off_where_sure: float
    """Pixels with a confidence above a half, and how many of those are off."""
    moving_found: float
    """Of what moves,"""
    moving_wrong: float
    """and what does not and was said to, of the picture."""
    speckles: float
    """Of at most `SPECKLE` pixels, in 100,000 pixels of the picture."""


def measure(inverse: Floats, confidence: Floats, moving: Mask, true: Floats, moves: Mask) -> Figures:
    """Inverse depths (h, w) against the truth, in the truth's units."""
    low, high = np.percentile(true, [2, 98])
    error = np.abs(inverse - true) / (high - low)
    still, off = ~moves, error > OFF
    edges = still & near_edges(true, JUMP * (high - low))
    sure = still & (confidence > 0.5)

    def share(what: Mask, among: Mask) -> float:
        return 100 * float(what[among].mean()) if among.any() else float("nan")

    return Figures(
        100 * float(np.median(error[still])), 100 * float(np.percentile(error[still], 90)),
        share(off, still), share(off, edges), share(sure, still), share(off, sure),
        share(moving, moves), 100 * float(np.mean(moving & still)), speckles(inverse),
    )  # fmt: skip


def speckles(inverse: Floats) -> float:
    """Isolated regions of at most `SPECKLE` pixels of inverse depths (h, w) that lie deeper than all around
    them, in 100,000 pixels.

    Deeper is by `DEEPER` than a grey closing, of 5 x 5 pixels, of the map.
    """
    low, high = np.percentile(inverse, [1, 99])
    filled = cv2.morphologyEx(inverse.astype(np.float32), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    deep = filled - inverse > DEEPER * (high - low)
    _, _, found, _ = cv2.connectedComponentsWithStats(deep.astype(np.uint8), connectivity=8)
    return 1e5 * int((found[1:, cv2.CC_STAT_AREA] <= SPECKLE).sum()) / inverse.size


def near_edges(true: Floats, jump: float) -> Mask:
    """(h, w) within `BAND` pixels of a jump of the true inverse depth."""
    square = np.ones((3, 3))
    edge = (cv2.dilate(true, square) - cv2.erode(true, square)) > jump
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * BAND + 1, 2 * BAND + 1))
    return np.asarray(cv2.dilate(edge.astype(np.uint8), disc) > 0)


def triangles(reconstruction: Reconstruction, frame: int, shape: tuple[int, int]) -> Floats:
    """(h, w) inverse depth that is linear over Delaunay triangles of the features, outside the nearest's."""
    features = frame_features(reconstruction, frame, reconstruction.canvas(frame))
    places = np.stack(np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5), axis=-1)
    inside = LinearNDInterpolator(features.projected, features.inverse_depth)(places)
    around = NearestNDInterpolator(features.projected, features.inverse_depth)(places)
    return np.asarray(np.where(np.isfinite(inside), inside, around))


def upright(result: DenseDepth, reconstruction: Reconstruction, shape: tuple[int, int]) -> tuple[Floats, ...]:
    """Inverse depth, confidence and what moves (h, w) in pixels of the source frame."""
    image, _ = reconstruction.image_at(result.frame)
    canvas = reconstruction.canvas(image)
    grid = np.stack(np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5), axis=-1)
    at = canvas.features_from_source(grid) * (result.pinhole.width / canvas.pinhole.width) - 0.5
    maps = (result.inverse_depth, result.confidence, result.moving.astype(np.float32))
    how = {"interpolation": cv2.INTER_NEAREST, "borderMode": cv2.BORDER_REPLICATE}
    return tuple(cv2.remap(m, at.astype(np.float32), None, **how).astype(np.float64) for m in maps)  # type: ignore[call-overload]


def in_metres(reconstruction: Reconstruction, frame: int, true: Floats) -> float:
    """The factor from a solve's inverse depths to the true ones (h, w): the median at its features."""
    features = frame_features(reconstruction, frame, reconstruction.canvas(frame))
    column, row = np.clip(features.observed, 0, [true.shape[1] - 1, true.shape[0] - 1]).astype(int).T
    return float(np.median(true[row, column] / features.inverse_depth))


def rows(scene: Case, pictures: Path | None) -> list[str]:
    """Of the table, for one scene."""
    made = []
    for track in ("T1", "T2"):
        if track == "T2" and scene.solve is None:
            continue
        solved = load_solve(scene.solve).reconstruction if track == "T2" and scene.solve else None
        taken: dict[str, list[Figures]] = {"dense": [], "fused": [], "triangles": []}
        seconds: dict[str, list[float]] = {"dense": [], "fused": [], "triangles": []}
        for frame in scene.frames:
            reconstruction = solved or scene.known(frame)
            true, moves = 1 / scene.depth(frame), scene.moves(frame)
            shape = (true.shape[0], true.shape[1])
            metres = in_metres(reconstruction, frame, true) if solved else 1.0
            stereo = PlaneSweepStereo(reconstruction, scene.footage.read)
            for way, source in (("dense", stereo), ("fused", TemporalFusion(reconstruction, stereo))):
                # Pictures are read before the clock starts.
                stereo.at(frame)
                began = time.perf_counter()
                result = source.at(frame)
                seconds[way].append(time.perf_counter() - began)
                inverse, confidence, moving = upright(result, reconstruction, shape)
                taken[way].append(measure(metres * inverse, confidence, moving > 0.5, true, moves))
                if pictures:
                    name = f"{scene.name}-{track}-{way}-{frame:04d}"
                    write(pictures, name, metres * inverse, confidence, moving, true)
            none = np.zeros(shape)
            sparse = metres * triangles(reconstruction, frame, shape)
            taken["triangles"].append(measure(sparse, none, none > 0, true, moves))
        for way, figures in taken.items():
            made.append(row(scene.name, track, way, figures, seconds[way]))
    return made


def row(name: str, track: str, way: str, figures: list[Figures], seconds: list[float]) -> str:
    """Of the table: means over the frames."""
    mean = np.array([list(vars(one).values()) for one in figures]).mean(axis=0)
    cells = ["" if np.isnan(value) else f"{value:.2f}" for value in mean]
    return " | ".join(
        [f"| {name}", track, way, *cells, f"{np.mean(seconds):.2f}" if seconds else "", ""]
    ).rstrip()


HEAD = """\
| scene | track | way | median | 90th | off | at edges | sure | off there | moving | wrongly | speckles | s |
|---|---|---|---|---|---|---|---|---|---|---|---|---|"""


def write(folder: Path, name: str, inverse: Floats, confidence: Floats, moving: Floats, true: Floats) -> None:
    """True and found depth above error and confidence, with what moves in white, as a PNG."""
    folder.mkdir(parents=True, exist_ok=True)
    low, high = np.percentile(true, [1, 99])
    span = high - low

    def bytes_of(values: Floats) -> NDArray[np.uint8]:
        return (255 * np.clip(values, 0, 1)).astype(np.uint8)

    depths = [
        cv2.applyColorMap(bytes_of((q - low + 0.1 * span) / (1.2 * span)), cv2.COLORMAP_TURBO)
        for q in (true, inverse)
    ]
    depths[1][cv2.morphologyEx(moving, cv2.MORPH_GRADIENT, np.ones((3, 3))) > 0.5] = 255
    error = cv2.applyColorMap(bytes_of(np.abs(inverse - true) / span / 0.2), cv2.COLORMAP_HOT)
    sure = cv2.cvtColor(bytes_of(confidence), cv2.COLOR_GRAY2BGR)
    cv2.imwrite(str(folder / f"{name}.png"), np.vstack([np.hstack(depths), np.hstack([error, sure])]))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", nargs="*", default=SCENES, help=f"of {', '.join(SCENES)}")
    parser.add_argument("--pictures", type=Path, help="folder for a picture of each depth")
    arguments = parser.parse_args()
    print(HEAD, flush=True)
    for name in arguments.scenes:
        print("\n".join(rows(case(name), arguments.pictures)), flush=True)


if __name__ == "__main__":
    main()
