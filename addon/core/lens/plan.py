"""The plan of one frame: its warp mesh and the views of the virtual cameras. Rendering only follows it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Mask
from ..base.errors import UserError
from ..camera.canvas import Canvas, Picture
from ..camera.reconstruction import Floats, Reconstruction
from ..depth.sparse import FrameFeatures, MappedDepth, frame_features
from ..warp.content_preserving import allowed, fading, grid_mesh
from ..warp.disocclusion_fill import HiddenColours
from ..warp.edge_constrained import edge_mesh
from ..warp.layered_depth_image import LayeredDepthImage
from ..warp.layered_mesh import LayeredMeshOptions, layer_mesh
from ..warp.mesh import WarpMesh, feature_mesh, thesis_mesh
from .aperture_sampling import random_disc, views_needed, vogel_disc
from .focus import Focus, exact_registration, fitted_registration

METHODS = ("layers", "features", "thesis", "grid", "edges")
ACCEPTABLE = 1500
MAX_BLUR = 16.0
"""Picture diagonals; in a larger disc nothing is left of what it comes from."""
MAX_RADIUS = 100.0
"""Times the focus distance; with a larger aperture radius the focal plane as good as lies in the lens."""


@dataclass(frozen=True)
class LensSettings:
    """The lens to simulate."""

    focus: Focus
    radius: float
    """Radius of the virtual aperture in scene units."""
    views: int = 0
    """Number of virtual cameras; 0 takes as many as the largest blur disc of the frame needs."""
    method: str = "layers"
    seed: int = 0
    """Of the random positions of the thesis's method."""
    borrow: bool = True
    """What a frame does not show is taken from the frames that do."""


@dataclass(frozen=True)
class FramePlan:
    """Everything that the renderer needs besides the frame's picture."""

    frame: int
    canvas: Canvas
    mesh: WarpMesh
    offsets: Floats
    """(N, 2) virtual camera positions in scene units along the actual camera's x (right) and y (down)."""
    registration: Floats
    """(N, 2, 3) maps from pixels of a synthesized view to pixels in register with the focal plane."""
    focus_inverse_depth: float
    blur: float
    """Diameter of the frame's largest blur disc in pixels (99 % of the features)."""
    carried: bool
    """The frame was not registered; its camera comes from its neighbours."""

    def displace(self, xy: Floats, inverse_depth: Floats) -> Floats:
        """(N, V, 2) where the views see vertices (V, 2) of inverse depth (V,), after registration."""
        moved = xy - (self.canvas.pinhole.focal * self.offsets)[:, None, :] * inverse_depth[:, None]
        turned = np.einsum("nij,nvj->nvi", self.registration[:, :, :2], moved)
        return np.asarray(turned + self.registration[:, None, :, 2])


def check_settings(settings: LensSettings) -> None:
    """UserError for an aperture, a number of views or a method that means nothing."""
    if not (np.isfinite(settings.radius) and settings.radius > 0):
        raise UserError(f"the aperture radius is {settings.radius:g}; it must be greater than zero")
    if settings.views < 0:
        raise UserError(f"the number of views is {settings.views}; it must be at least 1")
    if settings.method not in METHODS:
        raise UserError(f"there is no method {settings.method!r}; choose one of {', '.join(METHODS)}")


def plan_frame(
    reconstruction: Reconstruction,
    frame: int,
    settings: LensSettings,
    size: tuple[int, int],
    depth: MappedDepth | None = None,
) -> FramePlan:
    """Warp mesh and views of one frame, for a rendered frame of size (width, height) pixels.

    `depth` takes the place of the features' depth, except in the thesis's method. The methods "layers" and
    "edges" have the mesh over the features until they get the picture: `layered_plan`, `edged_plan`.
    Raises UserError for settings that mean nothing, and where the frame's geometry does not carry them.
    """
    check_settings(settings)
    image, _ = reconstruction.image_at(frame)
    canvas = Canvas(reconstruction.intrinsics(image).scaled(*size))
    features = frame_features(reconstruction, frame, canvas)
    if depth is not None and settings.method != "thesis":
        features = depth.features(features, canvas)
    inverse = settings.focus.inverse_depth(reconstruction, frame)
    check_blur(features, canvas, settings.radius, inverse)
    blur = largest_blur(features, canvas, settings.radius, inverse)
    count = settings.views or views_needed(blur)
    if settings.method == "thesis":
        offsets = settings.radius * random_disc(count, settings.seed)
        mesh = thesis_mesh(features, canvas)
        registration = fitted_registration(reconstruction, features, canvas, offsets, settings.focus)
    else:
        offsets = settings.radius * vogel_disc(count)
        registration = exact_registration(canvas, offsets, inverse)
        over = _grid_over if settings.method == "grid" else _features_over
        mesh = over(reconstruction, features, canvas, settings.radius, inverse)
    return FramePlan(frame, canvas, mesh, offsets, registration, inverse, blur, features.carried)


def can_be_layered(plan: FramePlan) -> bool:
    """Whether the frame's largest discs leave anything of its surfaces; else a coarse mesh does as well."""
    pinhole = plan.canvas.pinhole
    return plan.blur / 2 < LayeredMeshOptions.widest * max(pinhole.width, pinhole.height)


def layered_plan(
    plan: FramePlan,
    radius: float,
    picture: Picture,
    inverse_depth: Floats,
    hidden_colours: HiddenColours | None = None,
) -> tuple[FramePlan, Picture, tuple[LayeredDepthImage, ...]]:
    """The plan with a mesh of layers, the texture (h, w, 4) that belongs to it, and the layers.

    `picture` (H, W, 4) is the canvas picture and `inverse_depth` (H, W) that of all its pixels;
    `hidden_colours` are other frames' colours for what it does not show.
    """
    focus = plan.focus_inverse_depth
    scale = radius * plan.canvas.pinhole.fx

    def settle(shift: Floats) -> Floats:
        return scale * in_focus(shift / scale, plan.canvas, radius, focus)

    def fill(shift: Floats, asked: Mask) -> tuple[Picture, Mask]:
        assert hidden_colours is not None
        row, column = np.nonzero(asked)
        corner = (np.array(shift.shape) - picture.shape[:2]) // 2
        places = np.column_stack([column - corner[1], row - corner[0]]) + 0.5
        told, known = hidden_colours(places, shift[row, column] / scale)
        colour, found = np.zeros((*shift.shape, 3), np.float32), np.zeros(shift.shape, bool)
        colour[row, column], found[row, column] = told, known
        return colour, found

    mesh, texture, layers = layer_mesh(
        picture, scale * inverse_depth, scale * focus, scale, settle, fill if hidden_colours else None
    )
    return replace(plan, mesh=mesh), texture, layers


def edged_plan(
    plan: FramePlan,
    reconstruction: Reconstruction,
    radius: float,
    picture: Picture,
    depth: MappedDepth | None = None,
) -> FramePlan:
    """The plan with a mesh whose triangles' sides follow the edges of the canvas picture (h, w, 4)."""
    features = frame_features(reconstruction, plan.frame, plan.canvas)
    if depth is not None:
        features = depth.features(features, plan.canvas)
    features = _sharpened(features, plan.canvas, radius, plan.focus_inverse_depth)
    margin = _margin(features.inverse_depth, plan.canvas, radius, plan.focus_inverse_depth)
    return replace(
        plan, mesh=edge_mesh(features, plan.canvas, margin, picture, radius * plan.canvas.pinhole.fx)
    )


def _features_over(
    reconstruction: Reconstruction, features: FrameFeatures, canvas: Canvas, radius: float, focus: float
) -> WarpMesh:
    features = _sharpened(features, canvas, radius, focus)
    return feature_mesh(features, canvas, _margin(features.inverse_depth, canvas, radius, focus))


def _grid_over(
    reconstruction: Reconstruction, features: FrameFeatures, canvas: Canvas, radius: float, focus: float
) -> WarpMesh:
    weights = fading(reconstruction, features.frame, features.points)
    span = in_focus(np.array(allowed(features.inverse_depth, focus)), canvas, radius, focus)
    mesh = grid_mesh(features, weights, canvas, _margin(span, canvas, radius, focus), focus)
    # Only now: a subject in the focal plane must not flatten what is between it and the rest.
    return replace(mesh, inverse_depth=in_focus(mesh.inverse_depth, canvas, radius, focus))


def _sharpened(features: FrameFeatures, canvas: Canvas, radius: float, focus: float) -> FrameFeatures:
    return replace(features, inverse_depth=in_focus(features.inverse_depth, canvas, radius, focus))


def largest_blur(
    features: FrameFeatures, canvas: Canvas, radius: float, inverse_depth: float, share: float = 99.0
) -> float:
    """Diameter in pixels of the largest blur disc among `share` % of the features: D = 2 R f |1/Z - 1/Zf|."""
    if not len(features.inverse_depth):
        return 0.0
    contrast = float(np.percentile(np.abs(features.inverse_depth - inverse_depth), share))
    return 2 * float(radius) * canvas.pinhole.fx * contrast


def check_blur(features: FrameFeatures, canvas: Canvas, radius: float, inverse_depth: float) -> None:
    """UserError where the focal plane lies in the lens, or half of the features have discs beyond use."""
    if not float(radius) * inverse_depth <= MAX_RADIUS:
        raise UserError(
            f"frame {features.frame}: the focal plane at distance {1 / inverse_depth:g} lies in the lens,"
            f" whose radius is {radius:g}; focus farther away or choose a smaller aperture"
        )
    usual = largest_blur(features, canvas, radius, inverse_depth, 50.0)
    if not usual <= MAX_BLUR * _diagonal(canvas):
        raise UserError(
            f"frame {features.frame}: half of the picture has blur discs more than"
            f" {usual / canvas.pinhole.width:.3g} pictures wide; choose a smaller aperture or a focus"
            " farther away"
        )


def in_focus(depths: Floats, canvas: Canvas, radius: float, inverse_depth: float) -> Floats:
    """Inverse depths, of any shape, moved into the focal plane where their blur disc is too small to be seen.

    The photographer's acceptable circle of confusion is the diagonal / 1500. Depths are not known better
    than that, and resampling by fractions of a pixel would cost the subject its sharpness; in the focal
    plane every view shows the source's own pixels. Discs of twice that size and more are left as they are,
    those between grow linearly. Points with a disc beyond `MAX_BLUR` come back to it.
    """
    # A radius of almost nothing puts everything in focus: infinity does the same.
    with np.errstate(over="ignore", divide="ignore"):
        a_pixel = 1.0 / np.float64(2 * radius * canvas.pinhole.fx)
        smallest, largest = a_pixel * _diagonal(canvas) * np.array([1 / ACCEPTABLE, MAX_BLUR])
    contrast = depths - inverse_depth
    size = np.abs(contrast)
    kept = np.where(size < 2 * smallest, np.maximum(0.0, 2 * (size - smallest)), np.minimum(size, largest))
    return np.asarray(inverse_depth + np.sign(contrast) * kept)


def _margin(inverse_depths: Floats, canvas: Canvas, radius: float, inverse_depth: float) -> float:
    """Pixels past the border that some view can see. The picture is mirrored out there, over and over."""
    contrast = np.abs(inverse_depths - inverse_depth).max(initial=0.0)
    return float(radius * canvas.pinhole.focal.max() * contrast + 2.0)


def _diagonal(canvas: Canvas) -> float:
    return float(np.hypot(canvas.pinhole.width, canvas.pinhole.height))
