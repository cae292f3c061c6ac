"""Blender's mask datablock as a mask of moving pixels: its splines, frame by frame."""

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import bpy
import cv2
import numpy as np

from ...core.base.arrays import Floats, Map
from ...core.base.nearest_fill import of_nearest
from ..base.timeline import go_to
from ..gpu import main_thread

CURVE = 16
"""Straight pieces that a curve between two points is drawn with."""
SHIFT = 4
"""Bits of a pixel's fraction that OpenCV draws with."""
FINER = 4
"""Times as fine as the picture outlines are drawn."""
FALLOFFS: dict[str, Callable[[Floats], Floats]] = {
    "SMOOTH": lambda left: left**2 * (3 - 2 * left),
    "SPHERE": lambda left: np.sqrt(left * (2 - left)),
    "ROOT": np.sqrt,
    "INVERSE_SQUARE": lambda left: left * (2 - left),
    "SHARP": lambda left: left**2,
}
"""Opacity over a feather with a remaining share, by Blender's names of falloffs but the linear one."""
BLENDS: dict[str, Callable[[Map, Map], Map]] = {
    "ADD": lambda value, own: value + own,
    "SUBTRACT": lambda value, own: value - own,
    "LIGHTEN": np.maximum,
    "DARKEN": np.minimum,
    "MUL": lambda value, own: value * own,
    "DIFFERENCE": lambda value, own: np.abs(value - own),
    "MERGE_SUBTRACT": lambda value, own: value - own * value,
}
"""Mixtures of opacities below a layer with its own, by Blender's names; others are `MERGE_ADD`."""


@dataclass(frozen=True)
class Layer:
    """One layer of a mask in one frame."""

    outlines: tuple[Floats, ...]
    """(n, 2) each, closed: 0 to 1 over the longer side of the picture, the shorter centred; y is up."""
    feathers: tuple[Floats, ...]
    """(n,) of each outline, the width of its feather there, in the same unit."""
    falloff: str
    """How opacity falls over the feather: Blender's name of it."""
    alpha: float
    blend: str
    is_inverted: bool
    overlaps: bool
    """True if areas inside two outlines are inside; else they are holes."""


@dataclass(frozen=True)
class DrawnMask:
    """A mask datablock over the frames of a clip."""

    name: str
    size: tuple[int, int]
    """(width, height) of the clip's picture."""
    layers: dict[int, tuple[Layer, ...]]
    """Layers of each frame."""

    def at(self, frame: int) -> Map | None:
        """Return the opacity (H, W) in [0, 1] of moving pixels over the clip's picture; None if unknown."""
        return None if frame not in self.layers else raster(self.layers[frame], self.size)

    def is_still(self, mask: bpy.types.Mask, frame: int) -> bool:
        """Return whether the datablock at a frame is unchanged; true if it cannot be evaluated."""
        if not mask.is_evaluated or frame not in self.layers:
            return True
        return _same(self.layers[frame], layers_of(mask))

    @property
    def digest(self) -> str:
        """64 hexadecimal digits of its outlines and feathers over all frames."""
        digest = hashlib.sha256()
        for frame, layers in sorted(self.layers.items()):
            for layer in layers:
                own = layer.falloff, layer.alpha, layer.blend, layer.is_inverted, layer.overlaps
                digest.update(repr((frame, own)).encode())
                for outline in (*layer.outlines, *layer.feathers):
                    digest.update(np.ascontiguousarray(outline).tobytes())
        return digest.hexdigest()


def drawn_mask(mask: bpy.types.Mask, frames: Iterable[int], size: tuple[int, int]) -> DrawnMask:
    """Read the mask in every frame of a clip of size (width, height), with shape keys and feather.

    Points that follow a track keep their place. The frames are evaluated in a temporary scene, on the main
    thread; the user's scene stays at its frame.
    """
    wanted = list(frames)

    def steps() -> main_thread.Steps[dict[int, tuple[Layer, ...]]]:
        found = dict[int, tuple[Layer, ...]]()
        scene = bpy.data.scenes.new("Virtual Aperture Mask")
        try:
            for frame in wanted:
                go_to(scene, frame)
                evaluated = mask.original.evaluated_get(scene.view_layers[0].depsgraph)
                found[frame] = layers_of(evaluated)
                yield len(found)
        finally:
            bpy.data.scenes.remove(scene)
        return found

    return DrawnMask(mask.name, size, main_thread.draw(steps(), len(wanted)))


def layers_of(mask: bpy.types.Mask) -> tuple[Layer, ...]:
    """Return the layers of a mask at the frame that it is evaluated at."""
    return tuple(
        Layer(
            tuple(map(_outline, splines)), tuple(map(_feather, splines)),
            layer.falloff, layer.alpha, layer.blend, layer.invert, layer.use_fill_overlap,
        )
        for layer in mask.layers
        if not layer.hide_render
        for splines in [[each for each in layer.splines if each.use_fill and len(each.points) > 1]]
    )  # fmt: skip


def follows_tracks(mask: bpy.types.Mask) -> bool:
    """Return whether points of the mask have tracks for parents, which are ignored."""
    points = (point for layer in mask.layers for spline in layer.splines for point in spline.points)
    return any(point.parent.id is not None for point in points)


def _feather(spline: bpy.types.MaskSpline) -> Floats:
    """(n,) the feather's width along the curve of a spline: from point to point, and over those between."""
    t, found = np.linspace(0, 1, CURVE, endpoint=False), []
    weights = [point.weight for point in spline.points]
    for number, (point, weight) in enumerate(zip(spline.points, weights, strict=True)):
        between = sorted((each.u, each.weight) for each in point.feather_points)
        u, width = zip((0.0, weight), *between, (1.0, weights[(number + 1) % len(weights)]), strict=True)
        piece = np.clip(np.searchsorted(u, t, side="right") - 1, 0, len(u) - 2)
        start, end = np.array(u)[piece], np.array(u)[piece + 1]
        share = (t - start) / np.maximum(end - start, 1e-9)
        if spline.weight_interpolation == "EASE":
            share = share**2 * (3 - 2 * share)
        found.append(np.array(width)[piece] * (1 - share) + np.array(width)[piece + 1] * share)
    return np.concatenate(found)


def _outline(spline: bpy.types.MaskSpline) -> Floats:
    """(n, 2) the closed curve of a spline: cubic Bezier pieces between its points."""
    points = np.array(
        [[point.handle_left[:2], point.co[:2], point.handle_right[:2]] for point in spline.points],
        dtype=np.float64,
    )
    after = np.roll(points, -1, axis=0)
    corners = np.stack([points[:, 1], points[:, 2], after[:, 0], after[:, 1]], axis=1)
    if not spline.use_cyclic:
        # An open one is closed by a straight line.
        corners[-1] = np.linspace(points[-1, 1], points[0, 1], 4)
    t = np.linspace(0, 1, CURVE, endpoint=False)
    weights = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    return np.asarray(np.einsum("kt,pkc->ptc", weights, corners).reshape(-1, 2))


def raster(layers: Iterable[Layer], size: tuple[int, int]) -> Map:
    """Return the opacity (H, W) in [0, 1] of layers, mixed like Blender's, at a size (width, height)."""
    value = np.zeros(size[::-1], np.float32)
    for layer in layers:
        inside = _filled(layer, size)
        own = inside if layer.blend == "REPLACE" else inside * np.float32(layer.alpha)
        own = 1 - own if layer.is_inverted else own
        value = np.clip(_mixed(value, own, layer), 0, 1)
    return np.asarray(value, np.float32)


def _filled(layer: Layer, size: tuple[int, int]) -> Map:
    """(H, W) in [0, 1]: 1 inside the outlines, a share on them, and the feather outside."""
    width, height = size
    # An outline is drawn finer, and its pixels counted. OpenCV counts from the centre of the first pixel.
    scale = max(size) * np.array([1.0, -1.0])
    places = [(o - 0.5) * scale + np.array([width, height]) / 2 for o in layer.outlines]
    drawn = [np.rint((FINER * each - 0.5) * 2**SHIFT).astype(np.int32) for each in places]
    inside = np.zeros((FINER * height, FINER * width), np.uint8)
    for group in [[one] for one in drawn] if layer.overlaps else [drawn] if drawn else []:
        cv2.fillPoly(inside, group, 255, shift=SHIFT)
    found: Map = cv2.resize(inside, size, interpolation=cv2.INTER_AREA) / np.float32(255)
    for outline, feather in zip(places, layer.feathers, strict=True):
        # To the left of an outline: of one that is drawn counterclockwise it lies within, where all is 1.
        (x, y), (to_x, to_y) = outline.T, np.roll(outline, -1, axis=0).T
        is_clockwise = np.sum(x * to_y - to_x * y) > 0
        if is_clockwise and (feather > 0).any():
            found = np.maximum(found, _feathered(outline, max(size) * feather, layer.falloff, size))
    return found


def _feathered(outline: Floats, feather: Floats, falloff: str, size: tuple[int, int]) -> Map:
    """(H, W) in [0, 1], 1 at an outline (n, 2) in pixels, 0 where its feather (n,), in pixels, ends."""
    after = np.roll(np.column_stack([outline, feather]), -1, axis=0)
    before = np.column_stack([outline, feather])
    # Two places a pixel: the distance to the outline is that to the nearest.
    steps = int(np.ceil(2 * np.abs(after - before)[:, :2].max(initial=0.5)))
    share = (np.arange(steps) / steps)[:, None, None]
    along = ((1 - share) * before + share * after).reshape(-1, 3)
    margin = 1 + int(np.ceil(feather.max()))
    column, row = np.floor(along[:, :2]).astype(int).T + margin
    shape = size[1] + 2 * margin, size[0] + 2 * margin
    seen = (column >= 0) & (row >= 0) & (column < shape[1]) & (row < shape[0])
    if not seen.any():
        return np.zeros(size[::-1], np.float32)
    values, seeds = np.zeros((*shape, 3), np.float32), np.zeros(shape, bool)
    values[row[seen], column[seen]], seeds[row[seen], column[seen]] = along[seen], True
    nearest = of_nearest(values, seeds)[0][margin:-margin, margin:-margin]
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    away = np.hypot(x - nearest[..., 0], y - nearest[..., 1])
    left = np.clip(1 - away / np.maximum(nearest[..., 2], 1e-6), 0, 1)
    return np.asarray(FALLOFFS[falloff](left) if falloff in FALLOFFS else left, np.float32)


def _mixed(value: Map, own: Map, layer: Layer) -> Map:
    """Blender's mixing of a layer with those below it, before it is clipped to 0 and 1."""
    if layer.blend == "REPLACE":
        return value + np.float32(layer.alpha) * (own - value)
    mix = BLENDS.get(layer.blend)
    return value + own * (1 - value) if mix is None else mix(value, own)


def _same(one: tuple[Layer, ...], other: tuple[Layer, ...]) -> bool:
    def plain(layer: Layer) -> tuple[object, ...]:
        shapes = [len(outline) for outline in layer.outlines]
        return shapes, layer.falloff, layer.alpha, layer.blend, layer.is_inverted, layer.overlaps

    if [plain(layer) for layer in one] != [plain(layer) for layer in other]:
        return False
    pairs = (
        (a, b)
        for x, y in zip(one, other, strict=True)
        for a, b in zip((*x.outlines, *x.feathers), (*y.outlines, *y.feathers), strict=True)
    )
    return all(np.allclose(a, b, rtol=0, atol=1e-6) for a, b in pairs)
