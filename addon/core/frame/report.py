"""A report on a drawn frame: mesh, error, sources of its pixels, blur and time."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..base.arrays import LinearRGBA, Map
from ..base.counting import counted, ranges
from ..depth.source import SURE
from .frame import Frame
from .inspection import SOURCES, blur_discs, largest_shown

CHOSEN, SURE_ENOUGH, GIVEN = "as chosen", "its depth is sure enough", "its depth is known"
"""Reasons why a frame was drawn by the selected method: layers need depth."""


@dataclass(frozen=True)
class FrameReport:
    """Figures of a frame; shares are per cent."""

    frame: int
    method: str
    why: str
    """The reason for `method`."""
    carried: bool
    """True if the frame was not registered."""
    sure: float | None
    """Share of the pixels with certain depth; None if the method has none, or it is the user's."""
    views: int
    triangles: int
    of_pixel_grid: float
    """Triangles as a share of those of a mesh with a vertex for every pixel."""
    own: float
    borrowed: float
    inpainted: float
    """Shares of the light of all pixels: the frame's own, other frames', inpainted or mirrored."""
    blur_median: float
    blur_largest: float
    """Diameters of the blur discs in pixels."""
    blur_shown: float
    """Diameter in pixels of the last colour in the picture of blur."""
    depth_seconds: float
    mesh_seconds: float
    draw_seconds: float

    def as_dict(self) -> dict[str, Any]:
        """Convert for JSON."""
        return asdict(self)

    def words(self) -> list[str]:
        """Return lines for the user."""
        lines = [f"frame {self.frame}: drawn by {self.method} with {counted(self.views, 'view')}: {self.why}"]
        if self.carried:
            lines.append("camera: interpolated from its neighbours, the frame was not solved")
        if self.sure is not None:
            lines.append(f"depth: sure in {self.sure:.1f}% of the pixels")
        return [
            *lines,
            f"mesh: {self.triangles:,} triangles, {self.of_pixel_grid:.1f}% of those of the pixel grid",
            f"pixels: {_shares(self.own, self.borrowed, self.inpainted)}",
            f"blur: discs of {self.blur_median:.1f} px (median) to {self.blur_largest:.1f} px;"
            f" the picture's last colours are {self.blur_shown:.1f} px",
            f"time: depth {self.depth_seconds:.1f} s, mesh and what it borrows {self.mesh_seconds:.1f} s,"
            f" drawing {self.draw_seconds:.1f} s",
        ]  # fmt: skip


@dataclass(frozen=True)
class Used:
    """The method that drew a frame, and its reason."""

    frame: int
    method: str
    why: str

    @classmethod
    def of(cls, frame: Frame) -> Used:
        """Describe the method of a frame."""
        why = CHOSEN
        if frame.is_layered:
            why = GIVEN if _confidence(frame) is None else SURE_ENOUGH
        return cls(frame.number, frame.mesher.name, frame.why or why)


def frame_report(frame: Frame, shares: LinearRGBA) -> FrameReport:
    """Report on a drawn frame.

    `shares` (H, W, 3) are the sources of its pixels, from `inspection.shares_of`.
    """
    views, used, confidence = frame.views, Used.of(frame), _confidence(frame)
    sure = None if confidence is None else 100 * float(np.mean(confidence > SURE))
    camera, triangles = views.canvas.camera, len(frame.mesh.triangles)
    signed = blur_discs(frame)
    known = np.abs(signed[np.isfinite(signed)])
    median, largest = (float(f(known)) if len(known) else 0.0 for f in (np.median, np.max))
    parts = {n: 100 * float(shares[..., k].mean(dtype=np.float64)) for k, n in enumerate(SOURCES)}
    return FrameReport(
        used.frame, used.method, used.why, frame.samples.pose_interpolated, sure, len(views.offsets),
        triangles, 100 * triangles / (2 * camera.width * camera.height),
        parts["own"], parts["borrowed"], parts["inpainted"], median, largest, largest_shown(signed),
        frame.depth_seconds, frame.mesh_seconds, frame.draw_seconds,
    )  # fmt: skip


def _confidence(frame: Frame) -> Map | None:
    """Return the (H, W) confidence of depth; None for given or no depth."""
    return None if frame.depth is None else frame.depth.confidence


def notes(frame: Frame) -> tuple[str, ...]:
    """Return what the user should know of a frame."""
    number, moved, wished, found = frame.number, frame.steadied, frame.options.stabilize, []
    if frame.samples.pose_interpolated:
        found.append(f"Frame {number} was not solved: its camera is interpolated from its neighbours")
    if moved and moved.strength < wished:
        found.append(
            f"Stabilize is {moved.strength:.2f} instead of {wished:.2f}: from a steadier path the camera"
            " would see what the clip does not show"
        )
    if frame.why:
        found.append(f"Frame {number} uses the method {frame.mesher.name}: {frame.why}")
    return tuple(found)


def summary(used: Iterable[Used], reports: Iterable[FrameReport] = ()) -> str:
    """Summarise the methods, their numbers of frames and reasons, and the sources of pixels in one line."""
    groups: dict[tuple[str, str], list[int]] = {}
    for one in used:
        groups.setdefault((one.method, one.why), []).append(one.frame)
    parts: list[str] = []
    for (method, why), frames in sorted(groups.items(), key=lambda item: -len(item[1])):
        count = counted(len(frames), "frame")
        # Frames are listed for all methods except the most frequent.
        which = f" ({ranges(sorted(frames))})" if parts else ""
        parts.append(f"{count}{which} drawn by {method}: {why}")
    if known := list(reports):
        means = np.mean([(one.own, one.borrowed, one.inpainted) for one in known], axis=0)
        parts.append(f"pixels: {_shares(*means.tolist())}")
    return "; ".join(parts)


def _shares(own: float, borrowed: float, inpainted: float) -> str:
    text = f"{own:.1f}% their own frame's, {borrowed:.1f}% other frames', {inpainted:.1f}% invented"
    nothing = 100 - own - borrowed - inpainted
    return text + (f", {nothing:.1f}% nothing" if nothing >= 0.05 else "")
