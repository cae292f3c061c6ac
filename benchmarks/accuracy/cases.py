"""What a method is given for one frame: by the truth (track T1), found from the video alone (T2), or from
the video with true mattes of what moves (T3), or a stroke on it (T4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.errors import UserError
from addon.core.base.store import Store
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Points, Reconstruction
from addon.core.depth.source import DepthSource, PixelDepth
from addon.core.depth.sparse import FrameFeatures, frame_features
from addon.core.depth.stereo_depth import whole_depth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlights import RESTORED, HighlightSettings
from addon.core.frame.quality import NORMAL, Quality
from addon.core.media.clip import open_footage
from addon.core.media.light import to_gray8, to_linear
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.tracking.klt import new_corners
from addon.core.sfm.workspace import load_solve
from addon.core.subjects.strokes import MarkedSubject, Stroke
from addon.core.warp.disocclusion_fill import HiddenColours

from .. import store
from ..cost import Cost, measured
from ..picked import pick
from . import oracle
from .scenes import Picture, Scene

Floats = NDArray[np.float64]

ON_SURFACE = 0.5
"""Pixels of the blur disc by which the focus may miss the surface seen there and still be picked on it."""
STEADY = 4
"""Consecutive frames after the first whose depth is timed, one of them a key frame."""


@dataclass(frozen=True)
class BenchmarkCase:
    """One frame, its clip and depth, and the lens; lengths in the reconstruction's own units."""

    frame: int
    picture: Picture
    """(H, W, 4) linear."""
    clip: ClipContext
    """As the product has it."""
    focus: Focus
    radius: float
    depth: Floats
    """(H, W), inf infinitely far: what methods get that want a depth map."""
    layers: Callable[[int], oracle.LayeredDepthImage | None]
    """The hidden surfaces past a margin in pixels; None where nobody knows them."""

    @property
    def reconstruction(self) -> Reconstruction:
        """Cameras and points, true or solved."""
        return self.clip.reconstruction

    @property
    def focus_depth(self) -> float:
        """Depth of the focal plane."""
        return 1 / self.focus.inverse_depth(self.reconstruction, self.frame)

    @property
    def focal(self) -> float:
        """In pixels."""
        image, _ = self.reconstruction.image_at(self.frame)
        return self.reconstruction.intrinsics(image).fx

    @property
    def disc(self) -> Floats:
        """(H, W) signed blur disc diameters in pixels, positive nearer than the focal plane."""
        return 2 * self.radius * self.focal * (1 / self.depth - 1 / self.focus_depth)


@dataclass(frozen=True)
class TrueDepth(DepthSource):
    """A scene's own depth as a depth source; coarse meshes get the feature points."""

    scene: Scene

    def at(self, frame: int, canvas: Canvas, picture: Picture) -> PixelDepth:
        """The true inverse depth of every pixel."""
        depth = self.scene.depth(frame)
        width, height = canvas.pinhole.width, canvas.pinhole.height
        if depth.shape != (height, width):
            depth = cv2.resize(depth, (width, height), interpolation=cv2.INTER_NEAREST)
            return PixelDepth(1 / depth)
        return PixelDepth(1 / depth, past_border=self.scene.past_border(frame))


@dataclass(frozen=True)
class ClipWithFill(ClipContext):
    """A clip whose hidden colours come from elsewhere than its own frames: a larger clip, or the truth."""

    fill: Callable[[int, Canvas, Picture, PixelDepth, HighlightSettings], HiddenColours] | None = None
    """What is `ClipContext.hidden_colours`."""
    whole: ClipContext | None = None
    """The clip with all of its cameras, which knows how bright lamps are."""

    def picture(self, frame: int, highlights: HighlightSettings) -> Picture:
        """As the whole clip has it."""
        if self.whole is None:
            return super().picture(frame, highlights)
        return self.whole.picture(frame, highlights)

    def hidden_colours(
        self,
        frame: int,
        canvas: Canvas,
        picture: Picture,
        depth: PixelDepth,
        highlights: HighlightSettings = RESTORED,
    ) -> HiddenColours:
        """Those of `fill`."""
        assert self.fill is not None
        return self.fill(frame, canvas, picture, depth, highlights)


class GroundTruth:
    """T1: true cameras and depth. Features are found in the frame, their depth is the truth's."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    @cached_property
    def whole(self) -> ClipContext:
        """The clip with its true cameras, and no features."""
        return ClipContext(self.scene.cameras, open_footage(self.scene.clip()).read)

    def case(self, frame: int, blur: int) -> BenchmarkCase:
        """One frame of the scene through a lens whose largest disc over the judged ones is `blur` pixels."""
        scene, true = self.scene, self.reconstruction((frame,))
        # Corners are found in each frame anew: with other frames they would seem to come and go.
        alone = replace(true, images=(true.image_at(frame)[0],))
        clip = ClipWithFill(
            alone, self.whole.read, TrueDepth(scene), fill=self.whole.hidden_colours, whole=self.whole
        )
        return BenchmarkCase(
            frame, to_linear(scene.frame(frame)), clip, self._focus(frame, blur),
            scene.radius(blur), scene.depth(frame), lambda margin: scene.layers(frame, margin),
        )  # fmt: skip

    def reconstruction(self, frames: Sequence[int]) -> Reconstruction:
        """The clip's cameras, and in some frames the corners that tracking would take, truly placed."""
        cameras, images, xyz = self.scene.cameras, [], np.zeros((0, 3))
        for image in cameras.images:
            if image.frame in frames:
                world, xy = self._corners(image)
                ids = np.arange(len(xyz), len(xyz) + len(world), dtype=np.int32)
                image, xyz = replace(image, xy=xy, points=ids), np.concatenate([xyz, world])
            images.append(image)
        points = Points(xyz, np.zeros((len(xyz), 3), np.uint8), np.zeros(len(xyz)))
        return replace(cameras, images=tuple(images), points=points)

    def _corners(self, image: Image) -> tuple[Floats, Floats]:
        """(n, 3) places in the world of a frame's corners, and (n, 2) pixels where it sees them."""
        depth, camera = self.scene.depth(image.frame), self.scene.cameras.intrinsics(image)
        grey = to_gray8(self.scene.frame(image.frame))
        xy = new_corners(grey, np.zeros((0, 2), np.float32)).astype(np.float64) + 0.5
        place = camera.pinhole_pixels(xy)
        column, row = np.clip(place, 0, [camera.width - 1, camera.height - 1]).astype(int).T
        z = depth[row, column]
        xy, place, z = (each[np.isfinite(z)] for each in (xy, place, z))
        rays = (place - camera.principal_point) / camera.focal
        local = np.column_stack([rays, np.ones(len(rays))]) * z[:, None]
        return (local - image.translation) @ image.rotation, xy

    def _focus(self, frame: int, blur: int) -> Focus:
        return Focus(distance=self.scene.focus_depth(frame, blur))


class FromVideo:
    """T2, T3 with mattes, or T4 with a stroke on each subject in the middle frame: cameras and points solved
    from the clip. The user's two inputs are set as a user would.

    The focus is picked in the picture where the subject is seen, on the first frame that is judged. A solve
    has no scale, so the amount of blur is set by eye: one radius for the clip, with which the features'
    discs have the true size in the median.
    """

    quality: Quality = NORMAL
    """Of the depth of every pixel."""

    def __init__(self, scene: Scene, mattes: bool = False, strokes: bool = False) -> None:
        """UserError for the mattes and strokes of a scene in which no subject moves."""
        if (mattes or strokes) and scene.matte(scene.judged(scene.blurs[0])[0]) is None:
            raise UserError("no person, animal or vehicle moves in this scene")
        self.scene = scene
        footage = scene.clip()
        code = store.digest(store.sources(*store.SOLVER))
        work = store.FOLDER / "solves" / f"{scene.name}-{scene.key}-{code}.aperture"
        SolveProcess(footage, work).wait()
        solve = load_solve(work)
        self.reconstruction = solve.reconstruction
        masks = scene.matte if mattes else None
        middle = int(self.reconstruction.frames[len(self.reconstruction.frames) // 2])
        marked = [
            MarkedSubject(name, (Stroke(middle, tuple((float(x), float(y)) for x, y in places)),))
            for name, places in (scene.strokes(middle) if strokes else {}).items()
        ]
        self.clip = ClipContext(
            self.reconstruction, open_footage(footage).read, masks=masks, marked=tuple(marked)
        )

    def with_depth(self, quality: Quality, folder: Path, frame: int) -> tuple[FromVideo, Cost]:
        """The same with the depth of a frame and some before it found in a quality, and kept below a folder;
        and what that costs a frame, in the mean of the last `STEADY`."""
        found = copy(self)
        # A folder each: a draft would take the depth of normal quality.
        keep = partial(_store, folder / quality.name)
        found.clip, found.quality = replace(self.clip, store=keep), quality
        first, *others = [int(each) for each in self.reconstruction.frames if each <= frame][-STEADY - 1 :]
        stereo = found.clip.stereo_of(quality)
        stereo.at(first)
        _, cost = measured(lambda: [stereo.at(each) for each in others])
        return found, Cost(cost.cpu_s / STEADY, cost.wall_s / STEADY, cost.peak_mb)

    def case(self, frame: int, blur: int) -> BenchmarkCase:
        """One of the judged frames of the scene through a lens whose largest disc is about `blur` pixels."""
        picture = to_linear(self.scene.frame(frame))
        inverse = whole_depth(self.clip.stereo_of(self.quality).at(frame), picture).inverse_depth
        with np.errstate(divide="ignore"):
            depth = 1 / inverse
        return BenchmarkCase(
            frame,
            picture,
            self.clip,
            self._focus(frame, blur),
            self._radius(blur),
            depth,
            lambda margin: None,
        )

    def _focus(self, frame: int, blur: int) -> Focus:
        scene = self.scene
        first = scene.judged(blur)[0]
        x, y = scene.focus_xy(first, blur)
        column, row = int(x), int(y)
        wanted = [1 / scene.focus_depth(frame, blur) for frame in scene.judged(blur)]
        camera = scene.cameras.intrinsics(scene.cameras.image_at(first)[0])
        off = 2 * scene.radius(blur) * camera.fx * (1 / scene.depth(first)[row, column] - np.array(wanted))
        subject = scene.subject(first)
        # The solve has no points on what moves.
        moves = subject is not None and subject[row, column]
        if np.abs(off).max() < ON_SURFACE and not moves:
            height, width = scene.depth(first).shape
            return pick(self.reconstruction, first, x / width, y / height)
        # Else, as between two subjects: the distance that the solve gives to the wanted depth, by its points.
        features, true = self._features(frame)
        slope, offset = robust_line(1 / true, features.inverse_depth)
        return Focus(distance=float(1 / (slope / scene.focus_depth(frame, blur) + offset)))

    def _features(self, frame: int) -> tuple[FrameFeatures, Floats]:
        """The frame's features and the true depth (n,) at each of them."""
        features = frame_features(self.reconstruction, frame, self.reconstruction.canvas(frame))
        depth = self.scene.depth(frame)
        column, row = np.clip(features.observed, 0, [depth.shape[1] - 1, depth.shape[0] - 1]).astype(int).T
        return features, depth[row, column]

    def _radius(self, blur: int) -> float:
        scene, ratios, weights = self.scene, [], []
        for frame in scene.judged(blur):
            features, true = self._features(frame)
            image, _ = scene.cameras.image_at(frame)
            wanted = scene.cameras.intrinsics(image).fx * (1 / true - 1 / scene.focus_depth(frame, blur))
            own, _ = self.reconstruction.image_at(frame)
            inverse = self._focus(frame, blur).inverse_depth(self.reconstruction, frame)
            found = self.reconstruction.intrinsics(own).fx * (features.inverse_depth - inverse)
            ratios.append(wanted / np.where(found == 0, np.inf, found))
            weights.append(np.abs(found))
        return scene.radius(blur) * weighted_median(np.concatenate(ratios), np.concatenate(weights))


def _store(folder: Path, quality: Quality) -> Store:
    return Store(folder, lambda: quality.name)


def robust_line(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope and offset of y = slope x + offset, outliers of more than 3 scaled deviations left out."""
    keep = np.isfinite(x) & np.isfinite(y)
    for _ in range(5):
        slope, offset = np.polyfit(x[keep], y[keep], 1)
        miss = np.abs(slope * x + offset - y)
        keep = np.isfinite(miss) & (miss <= 3 * 1.4826 * np.median(miss[keep]) + 1e-12)
    return float(slope), float(offset)


def weighted_median(values: Floats, weights: Floats) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


def track(name: str, scene: Scene) -> GroundTruth | FromVideo:
    """The track T1, T2, T3 or T4 of a scene; UserError where it has none."""
    return GroundTruth(scene) if name == "T1" else FromVideo(scene, name == "T3", name == "T4")
