"""What a drawn frame is made of, in figures: mesh, error, sources of its pixels, blur and time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..base.arrays import Floats, LinearRGBA, Map
from ..base.counting import counted, ranges
from ..depth.source import SURE
from ..warp.layered_mesh import ERROR, RELATIVE_ERROR
from ..warp.rasterise import at_pixels
from .inspection import SOURCES, blur_discs, largest_shown, surface_of
from .warped_frame import WarpedFrame

CHOSEN, SURE_ENOUGH, GIVEN = "as chosen", "its depth is sure enough", "its depth is known"
"""Why a frame got the method that was asked for: layers need depth."""


@dataclass(frozen=True)
class FrameReport:
    """Of one frame. Shares are per cent."""

    frame: int
    method: str
    why: str
    """Why it was drawn with `method`."""
    carried: bool
    """The frame was not registered."""
    sure: float | None
    """Share of the pixels whose depth is sure; None where the method has none, or it is the user's."""
    views: int
    triangles: int
    of_pixel_grid: float
    """Triangles as a share of those of a mesh with a vertex for every pixel."""
    bound: tuple[float, float] | None
    """Pixels by which a view may see the mesh beside where the depth puts it, and of the blur's radius there
    how much more (a share); `quadtree.AT_SILHOUETTES` times that where depth jumps."""
    error_mean: float | None
    error_largest: float | None
    """Pixels by which the outermost view sees the mesh beside its place."""
    within_bound: float | None
    """Share of the pixels where the outermost view keeps the `bound`."""
    own: float
    borrowed: float
    inpainted: float
    """Shares of the light of all pixels: the frame's own, other frames', made up or mirrored."""
    blur_median: float
    blur_largest: float
    """Diameters of the blur discs in pixels."""
    blur_shown: float
    """Diameter in pixels that the last colour in the picture of blur stands for."""
    depth_seconds: float
    mesh_seconds: float
    draw_seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def words(self) -> list[str]:
        """Lines for people."""
        lines = [f"frame {self.frame}: drawn by {self.method} with {counted(self.views, 'view')}: {self.why}"]
        if self.carried:
            lines.append("camera: interpolated from its neighbours, the frame was not solved")
        if self.sure is not None:
            lines.append(f"depth: sure in {self.sure:.1f} % of the pixels")
        mesh = f"mesh: {self.triangles:,} triangles, {self.of_pixel_grid:.1f} % of those of the pixel grid"
        if self.bound is not None:
            mesh += (
                f"; off by {self.error_mean:.2f} px on average and {self.error_largest:.2f} px at most,"
                f" {self.within_bound:.1f} % within {self.bound[0]:g} px and {100 * self.bound[1]:g} % of the"
                " blur's radius"
            )
        return [
            *lines, mesh, f"pixels: {_shares(self.own, self.borrowed, self.inpainted)}",
            f"blur: discs of {self.blur_median:.1f} px (median) to {self.blur_largest:.1f} px;"
            f" the picture's last colours are {self.blur_shown:.1f} px",
            f"time: depth {self.depth_seconds:.1f} s, mesh and what it borrows {self.mesh_seconds:.1f} s,"
            f" drawing {self.draw_seconds:.1f} s",
        ]  # fmt: skip


@dataclass(frozen=True)
class Used:
    """Which method drew a frame, and why."""

    frame: int
    method: str
    why: str

    @classmethod
    def of(cls, warped: WarpedFrame) -> Used:
        """Which method a frame was drawn with, and why."""
        why = CHOSEN
        if warped.layers:
            why = GIVEN if _confidence(warped) is None else SURE_ENOUGH
        return cls(warped.plan.frame, warped.method, warped.why or why)


def frame_report(warped: WarpedFrame, shares: LinearRGBA, draw_seconds: float) -> FrameReport:
    """Of a frame whose views took `draw_seconds`; `shares` (H, W, 3) as `inspection.shares_of` gives them."""
    plan, used = warped.plan, Used.of(warped)
    confidence = _confidence(warped)
    sure = None if confidence is None else 100 * float(np.mean(confidence > SURE))
    camera, triangles = plan.canvas.camera, len(plan.mesh.triangles)
    signed = blur_discs(warped)
    known = np.abs(signed[np.isfinite(signed)])
    median, largest = (float(f(known)) if len(known) else 0.0 for f in (np.median, np.max))
    parts = {n: 100 * float(shares[..., k].mean(dtype=np.float64)) for k, n in enumerate(SOURCES)}
    bound, mean, worst, within = None, None, None, None
    if warped.layers:
        miss, allowed = mesh_error(warped)
        bound = (ERROR, RELATIVE_ERROR)
        mean, worst = float(miss.mean()), float(miss.max())
        within = 100 * float(np.mean(miss <= allowed))
    return FrameReport(
        used.frame, used.method, used.why, plan.pose_interpolated, sure, len(plan.offsets), triangles,
        100 * triangles / (2 * camera.width * camera.height), bound, mean, worst, within,
        parts["own"], parts["borrowed"], parts["inpainted"], median, largest, largest_shown(signed),
        warped.depth_seconds, warped.mesh_seconds, draw_seconds,
    )  # fmt: skip


def mesh_error(warped: WarpedFrame) -> tuple[Floats, Floats]:
    """(n,) pixels by which the outermost view sees the mesh beside where depth puts it, and what is allowed.

    Of every pixel of all surfaces that is seen from the frame's own place: what lies behind is a guess.
    """
    plan, layers = warped.plan, warped.layers
    shape = layers[0].disoccluded.shape
    margin = np.array(shape[::-1]) - [plan.canvas.pinhole.width, plan.canvas.pinhole.height]
    mesh = plan.mesh
    surface = surface_of(warped)[mesh.triangles[:, 0]]
    off, allowed = [], []
    seen = np.ones(shape, bool)
    for number in range(len(layers) + 1):
        rows = mesh.triangles[surface == number]
        drawn = at_pixels(mesh.xy + margin / 2, plan.lens.displacement(mesh.inverse_depth), rows, shape)
        covered = np.isfinite(drawn)
        shift = layers[-1].back_disparity
        if number < len(layers):
            shift = layers[number].front_disparity
            covered &= ~layers[number].is_far
        measured = seen & covered
        wanted = plan.lens.snap_displacement(shift[measured])
        off.append(np.abs(drawn[measured] - wanted))
        allowed.append(ERROR + RELATIVE_ERROR * np.abs(wanted))
        if number < len(layers):
            # A silhouette's pixels show both.
            seen &= (~covered | layers[number].mixed) & ~layers[number].disoccluded
    return np.concatenate(off), np.concatenate(allowed)


def _confidence(warped: WarpedFrame) -> Map | None:
    """(H, W) confidence in the depth of each pixel; None where depth was given or not asked for."""
    return None if warped.depth is None else warped.depth.confidence


def summary(used: Iterable[Used], reports: Iterable[FrameReport] = ()) -> str:
    """One line: which methods drew how many frames and why, and where their pixels came from."""
    groups: dict[tuple[str, str], list[int]] = {}
    for one in used:
        groups.setdefault((one.method, one.why), []).append(one.frame)
    parts: list[str] = []
    for (method, why), frames in sorted(groups.items(), key=lambda item: -len(item[1])):
        count = counted(len(frames), "frame")
        # Which ones, of those that are not as most are.
        which = f" ({ranges(sorted(frames))})" if parts else ""
        parts.append(f"{count}{which} drawn by {method}: {why}")
    if known := list(reports):
        means = np.mean([(one.own, one.borrowed, one.inpainted) for one in known], axis=0)
        parts.append(f"pixels: {_shares(*means.tolist())}")
    return "; ".join(parts)


def _shares(own: float, borrowed: float, inpainted: float) -> str:
    text = f"{own:.1f} % their own frame's, {borrowed:.1f} % other frames', {inpainted:.1f} % invented"
    nothing = 100 - own - borrowed - inpainted
    return text + (f", {nothing:.1f} % nothing" if nothing >= 0.05 else "")
