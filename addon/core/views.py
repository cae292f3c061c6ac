"""The plan of one frame: its warp mesh and the views of the virtual cameras. Rendering only follows it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .aperture import random_disc, views_needed, vogel_disc
from .canvas import Canvas
from .depth import FrameFeatures, frame_features
from .errors import UserError
from .focus import Focus, exact_registration, fitted_registration
from .reconstruction import Floats, Reconstruction
from .warpmesh import WarpMesh, feature_mesh, thesis_mesh

METHODS = ("features", "thesis")
ACCEPTABLE = 1500


@dataclass(frozen=True)
class LensSettings:
    """The lens to simulate."""

    focus: Focus
    radius: float
    """Radius of the virtual aperture in scene units."""
    views: int = 0
    """Number of virtual cameras; 0 takes as many as the largest blur disc of the frame needs."""
    method: str = "features"
    seed: int = 0
    """Of the random positions of the thesis's method."""


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
    reconstruction: Reconstruction, frame: int, settings: LensSettings, size: tuple[int, int]
) -> FramePlan:
    """Warp mesh and views of one frame, for a rendered frame of size (width, height) pixels."""
    check_settings(settings)
    image, _ = reconstruction.image_at(frame)
    canvas = Canvas(reconstruction.intrinsics(image).scaled(*size))
    features = frame_features(reconstruction, frame, canvas)
    inverse = settings.focus.inverse_depth(reconstruction, frame)
    blur = largest_blur(features, canvas, settings.radius, inverse)
    count = settings.views or views_needed(blur)
    if settings.method == "thesis":
        offsets = settings.radius * random_disc(count, settings.seed)
        mesh = thesis_mesh(features, canvas)
        registration = fitted_registration(reconstruction, features, canvas, offsets, settings.focus)
    else:
        offsets = settings.radius * vogel_disc(count)
        registration = exact_registration(canvas, offsets, inverse)
        sharpened = replace(features, inverse_depth=in_focus(features, canvas, settings.radius, inverse))
        mesh = feature_mesh(sharpened, canvas, _margin(features, canvas, settings.radius, inverse))
    return FramePlan(frame, canvas, mesh, offsets, registration, inverse, blur, features.carried)


def largest_blur(features: FrameFeatures, canvas: Canvas, radius: float, inverse_depth: float) -> float:
    """Diameter in pixels of the largest blur disc among 99 % of the features: D = 2 R f |1/Z - 1/Zf|."""
    if not len(features.inverse_depth):
        return 0.0
    contrast = np.percentile(np.abs(features.inverse_depth - inverse_depth), 99)
    return float(2 * radius * canvas.pinhole.fx * contrast)


def in_focus(features: FrameFeatures, canvas: Canvas, radius: float, inverse_depth: float) -> Floats:
    """(n,) inverse depths, moved into the focal plane where their blur disc is too small to be seen.

    The photographer's acceptable circle of confusion is the diagonal / 1500. Depths are not known better
    than that, and resampling by fractions of a pixel would cost the subject its sharpness; in the focal
    plane every view shows the source's own pixels. Discs of twice that size and more are left as they are,
    those between grow linearly.
    """
    diagonal = np.hypot(canvas.pinhole.width, canvas.pinhole.height)
    smallest = diagonal / ACCEPTABLE / (2 * radius * canvas.pinhole.fx)
    contrast = features.inverse_depth - inverse_depth
    size = np.abs(contrast)
    kept = np.where(size < 2 * smallest, np.maximum(0.0, 2 * (size - smallest)), size)
    return np.asarray(inverse_depth + np.sign(contrast) * kept)


def _margin(features: FrameFeatures, canvas: Canvas, radius: float, inverse_depth: float) -> float:
    """Pixels past the border that some view can see."""
    contrast = np.abs(features.inverse_depth - inverse_depth).max(initial=0.0)
    reach = radius * canvas.pinhole.focal.max() * contrast
    # The picture is mirrored out there, so more than its own size makes no sense.
    return float(min(reach + 2.0, 0.9 * min(canvas.pinhole.width, canvas.pinhole.height)))
