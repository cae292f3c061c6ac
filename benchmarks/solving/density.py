"""How many points a frame gains from other frames, and how many of them are truly there.

`python -m benchmarks.special density [SCENE ...]` prints a table; it films and solves the scenes below
build/figures first if need be. The truth is each point's own place in the scene: where the
surface is that an observation of it lies on, at about the depth that was solved.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, Ints
from addon.core.camera.reconstruction import Image, Reconstruction
from addon.core.sfm.mapping.visibility import visible_points
from addon.render.views.quiet import quiet
from sample_scenes import truth
from sample_scenes.stage import Stage

from ..thesis.clips import Clip

SCENES = ("bars", "boxes", "walk", "foreground", "fence")
SURFACE = 0.15
"""Of the frame's largest inverse depth: how well a solved depth must fit a surface to be of it."""
SLACK = 2
"""Pixels by which a feature's place is uncertain: as far off may a surface, or its own projection, be."""
SAME = 0.015
"""Of the depth, by which a surface seen at a point's projection may differ and be the point's own."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Density:
    """Means per frame."""

    observed: float
    candidates: float
    gained: float
    seen: float
    """Candidates that are truly to be seen,"""
    found: float
    """and those of them that were found."""
    covered: float
    """Found, but truly hidden by something nearer."""
    wrong: float
    """Found, but of a point that lies on no surface, or not where it truly is."""
    milliseconds: float
    """Of processor time."""

    def row(self, name: str) -> str:
        """Of the table."""
        return (
            f"| {name} | {self.observed:.0f} | {self.candidates:.0f} | {self.gained:.0f} |"
            f" {100 * self.gained / self.observed:.0f} % | {100 * self.found / self.seen:.0f} % |"
            f" {100 * self.covered / self.gained:.1f} % | {100 * self.wrong / self.gained:.1f} % |"
            f" {self.milliseconds:.0f} |"
        )


HEAD = """| scene | observed | candidates | gained | gain | of those to be seen | hidden | wrong | CPU ms |
|---|---|---|---|---|---|---|---|---|"""


@dataclass(frozen=True)
class TruePoints:
    """Where the points of a reconstruction truly are."""

    world: Floats
    """(m, 3) in frame 1 for things that move; NaN for a point on no surface."""
    thing: Ints
    """(m,) index into `Stage.things`."""

    def at(self, stage: Stage, index: int) -> Floats:
        """(m, 3) in a frame, counted from 0."""
        return self.world + travelled(stage, self.thing, index)


def travelled(stage: Stage, thing: Ints, index: int) -> Floats:
    """(n, 3) how far things have moved by a frame, counted from 0."""
    steps = [np.zeros(3) if t.travel is None else t.travel[index] for t in stage.things]
    return np.asarray(np.array([*steps, np.zeros(3)])[thing])


def around(picture: NDArray[np.generic], place: Floats) -> Floats:
    """(n, k) all pixels of a picture (H, W) within `SLACK` of places (n, 2); past its border the last."""
    height, width = picture.shape
    offset = np.arange(-SLACK, SLACK + 1)
    column, row = np.floor(place).astype(int).T
    rows = np.clip(row[:, None, None] + offset[:, None], 0, height - 1)
    columns = np.clip(column[:, None, None] + offset, 0, width - 1)
    return np.asarray(picture[rows, columns].reshape(len(place), -1), np.float64)


def true_points(stage: Stage, geometry: list[truth.Geometry], reconstruction: Reconstruction) -> TruePoints:
    """Of each point, the median over the observations whose surface has the solved depth, if most have.

    The solve's scale is each frame's own: the median ratio of true to solved depths.
    """
    places, things, points = [], [], []
    for image in reconstruction.images:
        place, thing, good = _surface(stage, geometry[image.frame - 1], reconstruction, image)
        places.append(place[good])
        things.append(thing[good])
        points.append(image.points[good])
    world, thing, point = np.concatenate(places), np.concatenate(things), np.concatenate(points)
    order = np.argsort(point, kind="stable")
    numbers, starts, counts = np.unique(point[order], return_index=True, return_counts=True)
    found = TruePoints(
        np.full((len(reconstruction.points), 3), np.nan), np.full(len(reconstruction.points), -1, np.int32)
    )
    for number, rows in zip(numbers, np.split(order, starts[1:]), strict=True):
        found.world[number], found.thing[number] = np.median(world[rows], axis=0), np.median(thing[rows])
    few = np.ones(len(reconstruction.points), bool)
    few[numbers] = counts <= reconstruction.views_per_point[numbers] / 2
    found.world[few] = np.nan
    return found


def _surface(
    stage: Stage, geometry: truth.Geometry, reconstruction: Reconstruction, image: Image
) -> tuple[Floats, Ints, Mask]:
    """Where a frame's observations (n, 3) lie in the scene, on which things, and which are on any at all."""
    index = image.frame - 1
    solved = image.to_camera(reconstruction.points.xyz[image.points])[:, 2]
    depth, thing = (around(part, image.xy) for part in (geometry.depth, geometry.thing))
    with np.errstate(invalid="ignore"):
        flat = depth.max(axis=1) < 1.02 * depth.min(axis=1)
    scale = np.median(depth[flat, 0] / solved[flat])
    largest = np.percentile(1 / geometry.depth, 98)
    error = np.abs(1 / depth - 1 / (scale * solved)[:, None])
    best = error.argmin(axis=1)
    rows = np.arange(len(best))
    depth, own = depth[rows, best], thing[rows, best].astype(np.int32)
    good = (error[rows, best] < SURFACE * largest) & np.isfinite(depth)
    cameras = stage.cameras
    rays = (image.xy - np.array([cameras.width, cameras.height]) / 2) / cameras.focal
    local = np.column_stack([rays, np.ones(len(rays))]) * np.where(good, depth, 1.0)[:, None]
    world = (local - cameras.translation[index]) @ cameras.rotation[index]
    return world - travelled(stage, own, index), own, good


def seen(
    stage: Stage, geometry: truth.Geometry, points: TruePoints, image: Image, projected: Floats
) -> tuple[Mask, Mask]:
    """(m,) which points are truly to be seen in a frame, and which are truly hidden in it; others are wrong.

    `projected` (m, 2) is where the solve has them.
    """
    index, cameras = image.frame - 1, stage.cameras
    local = points.at(stage, index) @ cameras.rotation[index].T + cameras.translation[index]
    with np.errstate(invalid="ignore"):
        place = cameras.focal * local[:, :2] / local[:, 2:] + np.array([cameras.width, cameras.height]) / 2
        right = np.linalg.norm(place - projected, axis=1) <= SLACK
    depth = around(geometry.depth, np.where(right[:, None], place, 0.0))
    with np.errstate(invalid="ignore"):
        own = np.abs(depth - local[:, 2:]) < SAME * local[:, 2:]
        nearer = depth < (1 - SAME) * local[:, 2:]
    return right & own.any(axis=1), right & nearer.all(axis=1)


def measure(clip: Clip) -> Density:
    """Every frame of a scene."""
    reconstruction, stage = clip.reconstruction, clip.stage
    with quiet(1):
        geometry = [truth.geometry(clip.scene, frame) for frame in clip.frames]
    points = true_points(stage, geometry, reconstruction)
    began = time.process_time()
    visible = visible_points(reconstruction, clip.footage)
    spent = time.process_time() - began
    counts = np.zeros(7)
    for image in reconstruction.images:
        local = image.to_camera(reconstruction.points.xyz)
        camera = reconstruction.intrinsics(image)
        place = camera.project(local)
        candidate = (local[:, 2] > 0) & np.all((place >= 0) & (place < [camera.width, camera.height]), axis=1)
        candidate[image.points] = False
        there, hidden = seen(stage, geometry[image.frame - 1], points, image, place)
        gained = np.zeros(len(candidate), bool)
        gained[visible[image.frame]] = True
        wrong = gained & ~there & ~hidden
        parts = (candidate, gained, candidate & there, gained & there, gained & hidden, wrong)
        counts += np.array([len(image.points), *(np.sum(part) for part in parts)])
    means = np.append(counts, 1000 * spent) / len(reconstruction.images)
    return Density(*means.tolist())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", nargs="*", default=SCENES, help=f"of {', '.join(SCENES)}")
    print(HEAD, flush=True)
    for name in parser.parse_args().scenes:
        print(measure(Clip(name)).row(name), flush=True)


if __name__ == "__main__":
    main()
