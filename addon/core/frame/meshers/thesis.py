"""The thesis's own method, the baseline: pinned corners, random positions, fitted registration."""

from dataclasses import replace

import numpy as np

from ...base.arrays import Floats
from ...base.errors import UserError
from ...camera.canvas import Canvas
from ...camera.reconstruction import Reconstruction, seen_by
from ...depth.sparse import FrameFeatures, frame_features
from ...focus.focus import Focus, check_points
from ...optics.aperture_sampling import random_disc
from ...warp.layer import Layer
from ...warp.mesh import WarpMesh, delaunay, distinct
from ..frame import Frame, Mesher
from ..views import Views


def make(frame: Frame) -> tuple[Layer, ...]:
    """Triangulate the features and the picture's pinned corners (section 3.4)."""
    features = frame_features(frame.clip.reconstruction, frame.number, frame.canvas)
    return (Layer(thesis_mesh(features, frame.canvas), frame.picture),)


def thesis_mesh(features: FrameFeatures, canvas: Canvas) -> WarpMesh:
    """Make the baseline mesh: Delaunay over the features and the four fixed image corners (section 3.7).

    Raises UserError for too few features, or if they cannot be triangulated.
    """
    keep = distinct(features, canvas)
    width, height = canvas.pinhole.width, canvas.pinhole.height
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
    texture = np.concatenate([features.observed[keep], corners])
    # A corner of zero inverse depth is fixed in every view.
    return WarpMesh(
        xy=np.concatenate([features.projected[keep], corners]),
        texture_xy=texture,
        inverse_depth=np.concatenate([features.inverse_depth[keep], np.zeros(4)]),
        triangles=delaunay(texture),
    )


def views(frame: Frame, count: int) -> Views:
    """Return random positions on a disc (section 3.5), registered by the picked points (section 3.8)."""
    reconstruction, options, canvas = frame.clip.reconstruction, frame.options, frame.canvas
    offsets = frame.lens.radius * random_disc(count, options.seed)
    features = frame_features(reconstruction, frame.number, canvas)
    registration = fitted_registration(reconstruction, features, canvas, offsets, options.focus)
    return replace(frame.views, offsets=offsets, registration=registration)


def fitted_registration(
    reconstruction: Reconstruction, features: FrameFeatures, canvas: Canvas, offsets: Floats, focus: Focus
) -> Floats:
    """Fit (N, 2, 3) scalings and translations that register the focus points (section 3.8).

    They use the frame's features if it sees at least two focus points, otherwise projections of the 3D focus
    points.
    """
    if len(focus.points) < 2:
        raise UserError("the thesis's method needs at least two focus points; pick four on the subject")
    ids = check_points(reconstruction, focus.points)
    seen = np.isin(features.points, ids)
    if seen.sum() >= 2:
        start, projected = features.observed[seen], features.projected[seen]
        inverse = features.inverse_depth[seen]
    else:
        image, _ = reconstruction.image_at(features.frame)
        local, ahead = seen_by(image, reconstruction, ids)
        local = local[ahead]
        if len(local) < 2:
            raise UserError(
                f"frame {features.frame} has fewer than two focus points in front of the camera;"
                " pick more points that lie ahead there"
            )
        start = projected = canvas.pinhole.project(local)
        inverse = 1.0 / local[:, 2]
    moved = projected - (canvas.pinhole.focal * offsets)[:, None, :] * inverse[:, None]
    centre, target = moved.mean(axis=1, keepdims=True), start.mean(axis=0)
    spread = ((moved - centre) ** 2).sum(axis=(1, 2))
    match = ((moved - centre) * (start - target)).sum(axis=(1, 2))
    # Coinciding focus points determine no scale.
    scale = np.divide(match, spread, out=np.ones_like(match), where=spread > 1e-9)
    registration = np.zeros((len(offsets), 2, 3))
    registration[:, 0, 0] = registration[:, 1, 1] = scale
    registration[:, :, 2] = target - scale[:, None] * centre[:, 0]
    return registration


MESHER = Mesher(
    "thesis", 1, "The 2010 baseline: pinned corners, random positions, fitted registration", make, views,
    takes_tilt=False, uses_given_depth=False, fewest_focus_points=2, settings=("seed",),
)  # fmt: skip
