"""A frame's mesh in a steadier camera, and the thin lens there.

The mesh is moved, not the picture: every view still samples the frame's own texture once. A triangle is
warped affinely between its vertices; for one 64 pixels wide, a rotation of two degrees at 60 degrees of view
leaves an error of a fortieth of a pixel.
"""

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats, LinearRGBA
from ..base.errors import UserError
from ..camera.canvas import Canvas
from ..camera.reconstruction import Image
from ..camera.steady_path import ALONG, SteadyPath, zoomed
from ..optics.breathing import magnified
from ..optics.thin_lens import ThinLens
from ..warp.mesh import WarpMesh


@dataclass(frozen=True)
class Steadied:
    """A steadier camera and the frame's own, which see the same surfaces."""

    canvas: Canvas
    """Canvas of the steadier camera."""
    lens: ThinLens
    """Its lens, focused on the same plane in space as the frame's."""
    own_canvas: Canvas
    own_lens: ThinLens
    """The frame's lens for the mesh, whose aperture includes all of the steadier one."""
    rotation: Floats
    """(3, 3) from the frame's camera space to the steadier camera's."""
    translation: Floats
    """(3,) of the same map, in scene units."""
    strength: float
    """Strength of the path's smoothing, reduced if the clip does not show enough."""

    @property
    def aperture_share(self) -> float:
        """Ratio of the aperture's radius to the radius of `own_lens`."""
        return self.lens.radius / self.own_lens.radius

    @property
    def middle(self) -> Floats:
        """(2,) x and y of the steadier aperture's centre in the frame's camera, in radii of `own_lens`."""
        return np.asarray((-self.rotation.T @ self.translation)[:2] / self.own_lens.radius)

    @property
    def enlargement(self) -> float:
        """Ratio of its focal length to the frame's."""
        return float(self.canvas.pinhole.fx / self.own_canvas.pinhole.fx)

    def magnified(self, picture: LinearRGBA) -> LinearRGBA:
        """Return a picture (H, W, 4) of the frame, at any size, as a camera that does not move sees it."""
        camera = self.canvas.camera.scaled(picture.shape[1], picture.shape[0])
        return magnified(picture, self.enlargement, camera.principal_point)

    def moved(self, xy: Floats, inverse_depth: Floats) -> tuple[Floats, Floats]:
        """Map canvas pixels (n, 2) and inverse depths (n,) of the frame to those of the steadier camera.

        Inverse depths are `rectified` by their lens.
        """
        there = self.own_lens.unrectified(inverse_depth, xy)
        pinhole, own = self.canvas.pinhole, self.own_canvas.pinhole
        rays = own.rays(xy)
        # With inverse depth d a point is (ray, d) in homogeneous coordinates, also at infinity.
        seen = rays @ self.rotation.T + np.multiply.outer(there, self.translation)
        places = seen[:, :2] / seen[:, 2:] * pinhole.focal + pinhole.principal_point
        return places, np.asarray(self.lens.rectified(there / seen[:, 2], places))

    def beyond(self, inverse_depths: Floats) -> float:
        """Return the pixels past the frame's border that the steadier camera sees.

        `inverse_depths` (k,) are those of the scene, in 1 / scene units.
        """
        pinhole, own = self.canvas.pinhole, self.own_canvas.pinhole
        size, there = np.array([pinhole.width, pinhole.height]), np.array([own.width, own.height])
        along = np.linspace(0, 1, ALONG)
        ends = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
        border = ends[np.any((ends == 0) | (ends == 1), axis=1)] * size
        rays = pinhole.rays(border)
        seen = (rays[None] - np.multiply.outer(inverse_depths, self.translation)[:, None]) @ self.rotation
        places = seen[..., :2] / seen[..., 2:] * own.focal + own.principal_point
        return float(max(np.max(-places), np.max(places - there), 0.0))

    def mesh(self, mesh: WarpMesh) -> WarpMesh:
        """Move a mesh of the frame to the steadier camera."""
        xy, inverse_depth = self.moved(mesh.xy, mesh.inverse_depth)
        return replace(mesh, xy=xy, inverse_depth=inverse_depth)


def steadied(
    image: Image, own: Canvas, lens: ThinLens, path: SteadyPath | None, enlarged: float = 1.0
) -> Steadied:
    """Steady a frame of a pose, a canvas and a lens by the steadier path of the clip, if any.

    `enlarged` is the ratio of the camera's focal length to the path's. Raises UserError if the focal plane is
    not in front of the steadier camera.
    """
    if path is None:
        rotation, translation, camera, strength = np.eye(3), np.zeros(3), own.camera, 0.0
    else:
        rotation, translation = path.seen_from(image)
        camera, strength = zoomed(own.camera, path.zoom), path.strength
    canvas = Canvas(replace(camera, fx=camera.fx * enlarged, fy=camera.fy * enlarged))
    # The focal plane is a . X = 1: inverse depth is a . ray, and a' . ray' in the other space.
    a = np.append(np.asarray(lens.slope) * own.pinhole.focal, lens.axis)
    there = rotation @ a
    ahead = 1 + float(there @ translation)
    if not (ahead > 0 and there[2] > 0):
        raise UserError(
            f"frame {image.frame}: the steadier camera is past the focal plane; lower Stabilize or focus"
            " farther away"
        )
    across, down, inverse = there / ahead
    slope = float(across / canvas.pinhole.fx), float(down / canvas.pinhole.fy)
    flat = ThinLens.on_plane(canvas.pinhole, lens.radius, float(inverse), slope)
    away = float(np.linalg.norm(translation[:2]))
    return Steadied(
        canvas, replace(flat.curved(lens.curvature), zone=lens.zone), own,
        replace(lens, radius=lens.radius + away), rotation, translation, strength,
    )  # fmt: skip
