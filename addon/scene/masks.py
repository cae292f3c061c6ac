"""Blender's mask datablock as a mask of what moves by itself: its splines, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import cv2
import numpy as np

from ..core.base.arrays import Floats, LinearRGBA, Mask
from . import main_thread

CURVE = 16
"""Straight pieces that a curve between two points is drawn with."""
SHIFT = 4
"""Bits of a pixel's fraction that OpenCV draws with."""


@dataclass(frozen=True)
class Layer:
    """One layer of a mask in one frame."""

    outlines: tuple[Floats, ...]
    """(n, 2) each, closed: 0 to 1 over the longer side of the picture, the shorter centred; y is up."""
    alpha: float
    blend: str
    is_inverted: bool
    overlaps: bool
    """What is inside two outlines is inside; else it is a hole."""


@dataclass(frozen=True)
class DrawnMask:
    """A mask datablock over the frames of a clip."""

    name: str
    size: tuple[int, int]
    """(width, height) of the clip's picture."""
    layers: dict[int, tuple[Layer, ...]]
    """Of each frame."""

    def at(self, frame: int) -> Mask | None:
        """(H, W) over the clip's picture, True where it moves by itself; None for a frame that is unknown."""
        return None if frame not in self.layers else raster(self.layers[frame], self.size)

    def is_still(self, mask: bpy.types.Mask, frame: int) -> bool:
        """Whether the datablock, evaluated at a frame, is what was taken; True where nobody can tell."""
        if not mask.is_evaluated or frame not in self.layers:
            return True
        return _same(self.layers[frame], layers_of(mask))


def drawn_mask(mask: bpy.types.Mask, frames: Iterable[int], size: tuple[int, int]) -> DrawnMask:
    """The mask at all frames of a clip of size (width, height), with its shape keys; feather is ignored.

    Points that follow a track stay where they were drawn. The frames are evaluated in a scene made for that,
    on the main thread, and the user's own scene stays at its frame.
    """
    wanted, found = list(frames), dict[int, tuple[Layer, ...]]()

    def steps() -> main_thread.Steps:
        scene = bpy.data.scenes.new("Virtual Aperture Mask")
        try:
            for frame in wanted:
                scene.frame_set(frame)
                evaluated = mask.original.evaluated_get(scene.view_layers[0].depsgraph)
                found[frame] = layers_of(evaluated)
                yield len(found)
        finally:
            bpy.data.scenes.remove(scene)
        return np.zeros((0, 0, 4), np.float32)

    main_thread.draw(steps(), len(wanted))
    return DrawnMask(mask.name, size, found)


def layers_of(mask: bpy.types.Mask) -> tuple[Layer, ...]:
    """What a mask shows at the frame that it is evaluated at."""
    return tuple(
        Layer(
            tuple(_outline(spline) for spline in layer.splines if spline.use_fill and len(spline.points) > 1),
            layer.alpha, layer.blend, layer.invert, layer.use_fill_overlap,
        )
        for layer in mask.layers
        if not layer.hide_render
    )  # fmt: skip


def follows_tracks(mask: bpy.types.Mask) -> bool:
    """Whether points of the mask have tracks for parents, which are ignored."""
    points = (point for layer in mask.layers for spline in layer.splines for point in spline.points)
    return any(point.parent.id is not None for point in points)


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


def raster(layers: Iterable[Layer], size: tuple[int, int]) -> Mask:
    """(H, W) bool of layers over each other as Blender mixes them, for a picture of size (width, height)."""
    value = np.zeros(size[::-1], np.float32)
    for layer in layers:
        inside = _filled(layer, size)
        own = inside if layer.blend == "REPLACE" else inside * np.float32(layer.alpha)
        own = 1 - own if layer.is_inverted else own
        value = np.clip(_mixed(value, own, layer), 0, 1)
    return np.asarray(value > 0.5)


def _filled(layer: Layer, size: tuple[int, int]) -> LinearRGBA:
    """(H, W) 1 inside the outlines."""
    width, height = size
    longer = max(size)
    scale = longer * np.array([1.0, -1.0])
    centre = np.array([width, height]) / 2
    # OpenCV counts from the centre of the first pixel.
    places = [np.rint(((o - 0.5) * scale + centre - 0.5) * 2**SHIFT).astype(np.int32) for o in layer.outlines]
    inside = np.zeros((height, width), np.uint8)
    for group in [[one] for one in places] if layer.overlaps else [places] if places else []:
        cv2.fillPoly(inside, group, 1, shift=SHIFT)
    return inside.astype(np.float32)


def _mixed(value: LinearRGBA, own: LinearRGBA, layer: Layer) -> LinearRGBA:
    """Blender's mixing of a layer with those below it, before it is clipped to 0 and 1."""
    match layer.blend:
        case "ADD":
            return value + own
        case "SUBTRACT":
            return value - own
        case "LIGHTEN":
            return np.maximum(value, own)
        case "DARKEN":
            return np.minimum(value, own)
        case "MUL":
            return value * own
        case "REPLACE":
            return value + np.float32(layer.alpha) * (own - value)
        case "DIFFERENCE":
            return np.abs(value - own)
        case "MERGE_SUBTRACT":
            return value - own * value
    return value + own * (1 - value)


def _same(one: tuple[Layer, ...], other: tuple[Layer, ...]) -> bool:
    def plain(layer: Layer) -> tuple[object, ...]:
        shapes = [len(outline) for outline in layer.outlines]
        return shapes, layer.alpha, layer.blend, layer.is_inverted, layer.overlaps

    if [plain(layer) for layer in one] != [plain(layer) for layer in other]:
        return False
    pairs = (
        (a, b) for x, y in zip(one, other, strict=True) for a, b in zip(x.outlines, y.outlines, strict=True)
    )
    return all(np.allclose(a, b, rtol=0, atol=1e-6) for a, b in pairs)
