"""Ratios of edges, estimated against measured, as a table and from overhead (the thesis's section 4.4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from string import ascii_uppercase

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from scipy.spatial import ConvexHull

from addon.core.base.arrays import Floats, Ints
from addon.core.sfm.workspace import Solve
from sample_scenes.stage import Edge

from . import lengths as measure
from .clips import Clip
from .marks import Figure
from .plots import DPI, rasterised

matplotlib.use("Agg")

EVERY = 3
"""Frames between two in which a corner is marked by hand."""
HELD = 0.5
"""Pixels of median reprojection error up to which a corner counts as followed."""
OWN = 1e-3
"""Metres within which a vertex of a thing is a corner."""
FOUND = {("BC", "AB"): "0.9 (Voodoo)", ("DE", "AB"): "2.9 (Voodoo)", ("DF", "BC"): "0.28 (Bundler)"}
"""What the thesis's two tools estimated for its boxes."""


@dataclass(frozen=True)
class Estimate:
    """The corners as one way of measuring finds them."""

    title: str
    solve: Solve
    xy: Floats
    """(F, k, 2) where they were seen, in pixels."""

    @cached_property
    def _found(self) -> tuple[Floats, Floats]:
        return measure.triangulated(self.solve.reconstruction, self.xy)

    @property
    def points(self) -> Floats:
        """(k, 3) in the solve's own units."""
        return self._found[0]

    @property
    def miss(self) -> Floats:
        """(k,) median reprojection error in pixels."""
        return np.asarray(np.nanmedian(self._found[1], axis=0))

    @property
    def seen(self) -> Ints:
        """(k,) frames."""
        return np.isfinite(self.xy[..., 0]).sum(axis=0).astype(np.int32)


def edge_lengths(clip: Clip) -> Figure:
    """Mark and follow the corners of the stage's edges, triangulate them, and compare lengths."""
    stage, middle = clip.stage, clip.middle
    world, edges = measure.corners_of(stage.edges)
    depth = {frame: clip.depth(frame) for frame in sorted({middle, *clip.frames[::EVERY]})}
    marks = measure.clicked(stage, depth, world)
    true = stage.cameras.project(world)
    start = measure.nearest_mark(marks, middle - 1)
    flow = measure.followed(clip.footage, start, true[start, np.arange(len(world))])
    by_hand = Estimate("marked by hand", clip.solved, marks)
    given = Estimate("marked, focal length given", clip.solve(stage.cameras.focal), marks)
    followed = Estimate("followed by flow", clip.solved, flow)
    slip = np.nanmax(np.linalg.norm(flow - true, axis=2), axis=0)
    error = [_errors(each, world, edges)[1:] for each in (by_hand, given)]
    mean = [float(np.nanmean(np.abs(each))) for each in error]
    focal = clip.solved.reconstruction.cameras[0].fx
    return Figure(
        f"edge_lengths_{clip.name}.png",
        _picture(clip, world, edges, by_hand, followed),
        "Left, the corners of the measured edges and the feature points of the middle frame; right, from"
        " overhead, the solved feature points, the true outline, and where the corners come out, marked by"
        f" hand (to a whole pixel in every {EVERY}rd frame that shows them) and followed by optical flow from"
        " one exact mark. Only position, turn and one scale are fitted to the truth.",
        "Figures 4-12 to 4-15 and the tables of section 4.4",
        f"The ratios to {stage.edges[0].name} are off by {mean[0]:.1f} % in the mean, with the true focal"
        f" length given by {mean[1]:.1f} %; the solve's focal length is {focal:.0f} px, the true"
        f" one {stage.cameras.focal:.0f} px.",
        _ratio_table(stage.edges, world, edges, by_hand, given, followed)
        + "\n"
        + _corner_table(stage.edges, edges, by_hand, followed, slip),
    )


def letters(edges: tuple[Edge, ...], rows: Ints) -> dict[int, str]:
    """Names of the corners: those of an edge such as AB are A and B, the others get the next letters."""
    names: dict[int, str] = {}
    for edge, pair in zip(edges, rows.tolist(), strict=True):
        if len(edge.name) == 2 and edge.name.isupper():
            names.update(zip(pair, edge.name, strict=True))
    for row in sorted(set(rows.ravel().tolist()) - set(names)):
        names[row] = next(letter for letter in ascii_uppercase if letter not in names.values())
    return names


def _held(estimate: Estimate, edges: Ints) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """(e,) both ends of the edge were followed through the whole clip, and fit one point."""
    good = (estimate.seen == len(estimate.xy)) & (estimate.miss < HELD)
    return np.asarray(good[edges].all(axis=1))


def _errors(estimate: Estimate, world: Floats, edges: Ints, first: int = 0) -> Floats:
    """(e,) percent by which an edge's ratio to that of row `first` is off."""
    found, true = measure.lengths(estimate.points, edges), measure.lengths(world, edges)
    return np.asarray(100 * (found / found[first] * true[first] / true - 1))


def _ratio_table(
    edges: tuple[Edge, ...], world: Floats, rows: Ints, by_hand: Estimate, given: Estimate, followed: Estimate
) -> str:
    names = [edge.name for edge in edges]
    true, found = (measure.lengths(points, rows) for points in (world, by_hand.points))
    held = _held(followed, rows)
    first = int(held.argmax())
    columns = [_errors(by_hand, world, rows), _errors(given, world, rows)]
    flow = _errors(followed, world, rows, first)
    lines = [
        "| ratio | measured | estimated | error | error, focal length given"
        f" | error by flow, to {names[first]} | the thesis's estimate |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {names[n]} / {names[0]} | {true[n] / true[0]:.2f} | {found[n] / found[0]:.2f} |"
        f" {columns[0][n]:+.1f} % | {columns[1][n]:+.1f} % |"
        f" {f'{flow[n]:+.1f} %' if held[n] else 'lost'} | {FOUND.get((names[n], names[0]), '')} |"
        for n in range(1, len(names))
    ]
    for over, under in FOUND:
        if under != names[0] and over in names and under in names:
            n, d = names.index(over), names.index(under)
            ratio = [found[n] / found[d], *(_errors(e, world, rows, d)[n] for e in (by_hand, given))]
            lines.append(
                f"| {over} / {under} | {true[n] / true[d]:.2f} | {ratio[0]:.2f} | {ratio[1]:+.1f} % |"
                f" {ratio[2]:+.1f} % | | {FOUND[over, under]} |"
            )
    return "\n".join(lines) + "\n"


def _corner_table(
    edges: tuple[Edge, ...], rows: Ints, by_hand: Estimate, followed: Estimate, slip: Floats
) -> str:
    lines = [
        "| corner | frames marked | reprojection error"
        " | frames followed by flow | reprojection error | slips by up to |",
        "|---|---|---|---|---|---|",
    ]
    for row, name in sorted(letters(edges, rows).items(), key=lambda item: item[1]):
        lines.append(
            f"| {name} | {by_hand.seen[row]} | {by_hand.miss[row]:.2f} px | {followed.seen[row]} of"
            f" {len(followed.xy)} | {followed.miss[row]:.2f} px | {slip[row]:.1f} px |"
        )
    return "\n".join(lines) + "\n"


def _picture(
    clip: Clip, world: Floats, edges: Ints, by_hand: Estimate, followed: Estimate
) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    plot, (left, right) = plt.subplots(1, 2, figsize=(13, 5.2), dpi=DPI, width_ratios=(1.35, 1))
    names = letters(clip.stage.edges, edges)
    at = clip.stage.cameras.project(world)[clip.middle - 1]
    image, _ = clip.reconstruction.image_at(clip.middle)
    width, height = clip.size
    left.imshow(clip.frame(clip.middle), extent=(0, width, height, 0))
    left.plot(*image.xy.T, ".", color="white", markersize=2)
    left.plot(*at.T, "s", color="white", markeredgecolor="black", markersize=7)
    _name(left, names, at, (4, 6))
    left.set_title(f"frame {clip.middle}: {len(image.points)} feature points and the corners")
    left.set_axis_off()
    _overhead(right, clip, world, by_hand, followed, image.points)
    _name(right, names, 100 * world[:, :2], (7, 5))
    plot.tight_layout()
    return rasterised(plot)


def _name(axis: Axes, names: dict[int, str], at: Floats, shift: tuple[int, int]) -> None:
    for row, name in names.items():
        label = axis.annotate(
            name, (at[row, 0], at[row, 1]), shift, textcoords="offset points", weight="bold"
        )
        label.set_path_effects([patheffects.withStroke(linewidth=3, foreground="white")])


def _overhead(
    axis: Axes, clip: Clip, world: Floats, by_hand: Estimate, followed: Estimate, points: Ints
) -> None:
    """From above, in centimetres of the scene, the solve brought onto the true corners."""
    scale, turn, shift = measure.similarity(by_hand.points, world)

    def placed(solved: Floats) -> Floats:
        return np.asarray(100 * (scale * solved @ turn.T + shift))

    for thing in clip.stage.things:
        apart = np.linalg.norm(thing.shape.vertices[:, None] - world, axis=2)
        if (apart < OWN).any():
            flat = 100 * thing.shape.vertices[:, :2]
            ring = ConvexHull(flat).vertices
            axis.fill(
                *flat[ring].T, facecolor="0.92", edgecolor="black", linewidth=1, label=f"true {thing.name}"
            )
    cloud = placed(clip.reconstruction.points.xyz[points])
    axis.plot(*cloud[:, :2].T, ".", color="tab:gray", markersize=2, label="feature points, solved")
    marked, flow = placed(by_hand.points), placed(followed.points)
    axis.plot(
        *marked[:, :2].T, "s", color="white", markeredgecolor="black", markersize=7, label="corners, marked"
    )
    axis.plot(*flow[:, :2].T, "^", color="none", markeredgecolor="tab:red", label="corners, by flow")
    middle, reach = 100 * world[:, :2].mean(axis=0), 130 * np.ptp(world[:, :2], axis=0).max() / 2
    axis.set(
        xlim=(middle[0] - reach, middle[0] + reach), ylim=(middle[1] - reach, middle[1] + reach),
        aspect="equal", xlabel="to the right, cm", ylabel="away from the camera, cm", title="from overhead",
    )  # fmt: skip
    axis.legend(fontsize=8, loc="lower right")
