"""The hard cases of `benchmarks.stability`; here those of the geometry: scales, depths, poses, features."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np

from addon.core.base.arrays import Floats, LinearRGBA
from addon.core.camera.reconstruction import (
    Image,
    Reconstruction,
    normalise,
)
from addon.core.focus.focus import Focus

from ..displaced import displaced
from ..picked import pick
from . import lens_cases
from .__main__ import Case, Measure
from .reference import (
    LENS,
    SCENE_SIZE,
    Plan,
    displacement_error,
    map_picture,
    moved,
    places,
    psnr,
    rendered,
    shot,
)
from .runs import (
    BAD,
    DEPTH,
    FOCUS,
    SIZE,
    compared,
    decibels,
    draw,
    folded,
    frontal,
    own_mesh,
    pixels,
    planned,
    spoilt,
)


def cases() -> list[Case]:
    """All cases; names are unique."""
    groups = (_scales, _depths, _poses, _focal_planes, _features, _frames)
    return [case for group in groups for case in group()] + list(lens_cases.cases())


@cache
def _plain() -> tuple[Plan, LinearRGBA]:
    plan = planned(shot())
    return plan, draw(plan)


def _scaled(scale: float, offset: float) -> list[Measure]:
    plain, picture = _plain()
    expected = displaced(plain.views, plain.mesh.xy, plain.mesh.inverse_depth)
    errors, quality = [], []
    raw = moved(shot(), scale, offset)
    for rec in (raw, normalise(raw)):
        plan = planned(rec)
        mean = draw(plan)
        moves = displaced(plan.views, plan.mesh.xy, plan.mesh.inverse_depth) - expected
        errors += [float(np.abs(moves).max()), displacement_error(mean, picture, SIZE)]
        quality.append(psnr(mean, picture))
    return [pixels(max(errors)), decibels(min(quality))]


def _scales() -> Iterator[Case]:
    # `normalise` runs at the end of a solve alone: all that reads a reconstruction must take any units.
    run = "raw and normalised, 16 views on the GPU, against scale 1"
    for scale in (1e-6, 1e-3, 1.0, 1e3, 1e6):
        for times in (0.0, 1e3, 1e5, 1e7):
            offset = times * scale * SCENE_SIZE
            name = f"scale {scale:g}, origin {times:g} scene sizes off"
            yield Case(name, run, partial(_scaled, scale, offset))
        for offset in (1e3, 1e5, 1e7):
            # Where a coordinate's last bit is a ten-thousandth of the depth, the file itself holds no better.
            expected = "either" if offset / scale > 1e12 else "right"
            name = f"scale {scale:g}, origin {offset:g} units off"
            yield Case(name, run, partial(_scaled, scale, offset), expected)


def _without_spoilt(depth: float) -> list[Measure]:
    """A few points that mean nothing must change nothing."""
    clean = shot(frames=(1,))
    image = clean.images[0]
    clean = replace(clean, images=(replace(image, xy=image.xy[BAD:], points=image.points[BAD:]),))
    expected = rendered(planned(clean), map_picture(*SIZE))
    rec = shot(depth=spoilt(depth), frames=(1,))
    measures = [compared(draw(planned(r)), expected) for r in (rec, normalise(rec))]
    assert len(pick(rec, 1, 0.5, 0.5).points) == 4
    return [pixels(max(m[0].value for m in measures)), decibels(min(m[1].value for m in measures))]


def _normalised(rec: Reconstruction) -> list[Measure]:
    return folded(planned(normalise(rec)))


def _depths() -> Iterator[Case]:
    run = f"{BAD} of 150 points, raw and normalised, against the float64 renderer without them"
    for depth in (1e-12, 1e-300, 5e-324, 0.0, -0.0, -1e-300, -3.0, np.inf, -np.inf, np.nan):
        yield Case(f"some depths {depth:g}", run, partial(_without_spoilt, depth))
    run = f"{BAD} of 150 points, against the float64 renderer"
    for depth in (1e-3, 0.1, 1e9, 1e300):
        rec = shot(depth=spoilt(depth), frames=(1,))
        for method in ("features", "thesis"):
            check = partial(own_mesh, rec, radius=0.3, method=method)
            yield Case(f"some depths {depth:g}, {method}", run, check)
    for depth in (0.0, -3.0, -1e-300, np.inf, np.nan):
        rec = shot(depth=depth, frames=(1,))
        yield Case(f"all depths {depth:g}", "aperture, plan", partial(own_mesh, rec), "refused")
        focus = Focus(distance=DEPTH)
        check = partial(own_mesh, rec, focus=focus, radius=0.3)
        yield Case(f"all depths {depth:g}, focus distance", "plan", check, "refused")
    for factor in (1e-12, 1e-300, 1e300):
        rec = shot(depth=factor * spoilt(8.0), frames=(1,))
        yield Case(
            f"all depths times {factor:g}",
            "plan, 16 views, float64 renderer",
            partial(own_mesh, rec),
            "either",
        )
        yield Case(
            f"all depths times {factor:g}, normalised", "the same", partial(_normalised, rec), "either"
        )
    rec = shot(depth=0.0, frames=(1,))
    yield Case("all points in the camera", "normalise", partial(_normalised, rec), "refused")


def _spoilt_pose(frame: int, spoil: Callable[[Image], Image], normal: bool) -> list[Measure]:
    rec = shot(frames=(1, 3, 5))
    rec = replace(rec, images=(rec.images[0], spoil(rec.images[1]), rec.images[2]))
    return own_mesh(normalise(rec) if normal else rec, frame=frame)


def _poses() -> Iterator[Case]:
    for value in (np.nan, np.inf):

        def turned(image: Image, value: float = value) -> Image:
            return replace(image, rotation=np.full((3, 3), value))

        def shifted(image: Image, value: float = value) -> Image:
            return replace(image, translation=np.array([0.0, value, 0.0]))

        for what, spoil in (("rotation", turned), ("translation", shifted)):
            name = f"{value:g} in a pose's {what}"
            yield Case(name, "its frame", partial(_spoilt_pose, 3, spoil, False), "refused")
            yield Case(
                f"{name}, between",
                "an unregistered neighbour",
                partial(_spoilt_pose, 4, spoil, False),
                "refused",
            )
            yield Case(f"{name}, elsewhere", "another frame", partial(_spoilt_pose, 1, spoil, False))
            yield Case(f"{name}, normalised", "normalise", partial(_spoilt_pose, 1, spoil, True), "refused")
    for focal in (0.0, np.nan):
        lens = replace(LENS, fx=focal)
        rec = replace(shot(), cameras=(lens,))
        yield Case(f"focal length {focal:g}", "aperture, plan", partial(own_mesh, rec), "refused")


def _in_focus(distance: float, radius: float, expected: float = 0.0) -> list[Measure]:
    """Everything in the focal plane: the source itself."""
    plan = planned(shot(depth=DEPTH), Focus(distance=distance), radius=radius)
    contrast = np.abs(plan.mesh.inverse_depth - plan.views.lens.focus).max()
    return [*compared(draw(plan), map_picture(*SIZE)), Measure(contrast, "of inverse depth", expected)]


def _focal_planes() -> Iterator[Case]:
    ulp = float(np.nextafter(DEPTH, 9.0))
    for radius in (0.3, 5.0, 50.0):
        run = f"aperture radius {radius:g}, against the source"
        yield Case(f"contrast 0, radius {radius:g}", run, partial(_in_focus, DEPTH, radius))
        yield Case(f"contrast one ulp, radius {radius:g}", run, partial(_in_focus, ulp, radius, 1e-16))
    run = "against the source"
    yield Case("contrast 0, radius 1e6", run, partial(_in_focus, DEPTH, 1e6), "either")
    yield Case("contrast one ulp, radius 1e6", run, partial(_in_focus, ulp, 1e6, 1e-16), "either")
    rec = shot(depth=DEPTH)
    yield Case("no contrast to measure", "aperture from blur", partial(own_mesh, rec), "refused")


def _placed(xy: Floats, method: str) -> list[Measure]:
    if method == "features":
        return frontal(planned(shot(LENS, DEPTH, xy), Focus(distance=FOCUS), radius=1.0))
    rec = shot(LENS, None, xy)
    return folded(planned(rec, Focus(points=(0, 1)), radius=1.0, method=method))


def _features() -> Iterator[Case]:
    line = np.linspace(2, 94, 40)[:, None]
    grid = places(LENS, 60)
    border = np.array([[0.0, 0], [96, 0], [0, 54], [96, 54], [48, 0], [0, 27]])
    close = np.array([[40.0, 20.0], [40.0 - 1e-9, 20.0]])
    in_cells = np.array([[40.1, 20.1], [40.9, 20.2], [40.2, 20.9], [40.8, 20.8]])
    sets: dict[str, tuple[Floats, str]] = {
        f"{n} features": (places(LENS, n), "refused" if n < 3 else "right") for n in range(6)
    }
    sets |= {
        "150 features in one place": (np.full((150, 2), 31.4), "refused"),
        "150 features in one half pixel": (31.1 + 0.002 * grid[:, :1] @ np.ones((1, 2)), "refused"),
        "4 features in one pixel": (in_cells, "right"),
        "every feature twice": (np.repeat(grid, 2, axis=0), "right"),
        "every feature twice, 1e-9 px apart": (np.concatenate([grid, grid + 1e-9]), "right"),
        "features that only float64 tells apart": (np.concatenate([close, grid]), "right"),
        "collinear features, across": (line * [1, 0] + [0, 20.25], "right"),
        "collinear features, down": (line * [0, 0.5] + [33.0, 1.0], "right"),
        "collinear features, diagonal": (line * [1, 0.5], "right"),
        "3 collinear features": (np.array([[10.0, 10], [20, 15], [30, 20]]), "right"),
        "all features on the border": (border, "refused"),
        "features a pixel from the border": (np.clip(border, 1, [95, 53]), "right"),
        "features outside the picture": (grid + np.array([200, 0]), "refused"),
    }  # fmt: skip
    for name, (xy, expected) in sets.items():
        for method, run in (
            ("features", "frontal plane, closed form"),
            ("thesis", "plane, float64 renderer"),
        ):
            yield Case(f"{name}, {method}", run, partial(_placed, xy, method), expected)


def _carried(frames: tuple[int, ...], frame: int) -> list[Measure]:
    """A frame outside the registered ones looks as the nearest one does."""
    rec = shot(frames=frames)
    nearest = min(frames, key=lambda f: abs(f - frame))
    plan = planned(rec, frame=nearest, radius=0.3)
    return compared(draw(planned(rec, frame=frame, radius=0.3)), rendered(plan, map_picture(*SIZE)))


def _frames() -> Iterator[Case]:
    for frame in (1, 0, -5, 7, 10**9):
        yield Case(f"one registered frame, frame {frame}", "float64 renderer", partial(_carried, (1,), frame))
    for frame in (1, -3, 9, 10**9):
        check = partial(_carried, (2, 3, 4), frame)
        yield Case(f"frames 2 to 4 registered, frame {frame}", "float64 renderer", check)
    check = partial(own_mesh, shot(frames=(1, 9)), frame=4, radius=0.3)
    yield Case("a frame in a gap", "float64 renderer", check)
    empty = replace(shot(), images=())
    yield Case("no registered frame", "plan", partial(own_mesh, empty, radius=0.3), "refused")
    yield Case("no registered frame, normalised", "normalise", partial(_normalised, empty), "refused")

    def picked() -> list[Measure]:
        pick(empty, 1, 0.5, 0.5)
        return []

    yield Case("no registered frame, picked", "pick", picked, "refused")
