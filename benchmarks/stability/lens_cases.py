"""Hard cases of the lens: aperture, focus, picture sizes, precision, distortion."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from addon.core.base.errors import UserError
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.optics.aperture_sampling import vogel_disc
from addon.render.views import gpu_views

from .__main__ import Case, Measure
from .reference import (
    FAR,
    LENS,
    NEAR,
    SCENE_SIZE,
    displacement_error,
    map_picture,
    moved,
    one_triangle,
    places,
    plane_picture,
    plane_places,
    psnr,
    shot,
)
from .runs import (
    BAD,
    DEPTH,
    FOCUS,
    SIZE,
    WIDE,
    decibels,
    draw,
    folded,
    frontal,
    own_mesh,
    pixels,
    plane,
    planned,
    spoilt,
    vertices,
)


def cases() -> Iterator[Case]:
    """The cases of this module."""
    groups = (
        _triangles, _apertures, _focuses, _wide_frames, _precision, _distortions,
    )  # fmt: skip
    for group in groups:
        yield from group()


def _one_triangle(
    scale: float, slope: float, radius: float = 1.0, camera: Intrinsics = LENS
) -> list[Measure]:
    disc = radius * scale * vogel_disc(16)
    slopes = slope / scale, -slope / 2 / scale
    inverse, focus = 1 / DEPTH / scale, 1 / FOCUS / scale
    plan = one_triangle(camera, inverse, slopes, focus, disc)
    return [*plane(plan, inverse, slopes, focus), *vertices(plan)]


def _triangles() -> Iterator[Case]:
    for scale in (1e-6, 1.0, 1e6):
        for slope in (0.0, 5e-4):
            name = f"one triangle over everything, slope {slope:g}, scale {scale:g}"
            yield Case(name, "slanted plane, closed form", partial(_one_triangle, scale, slope))


def _aperture(radius: float, views: int = 16, camera: Intrinsics = LENS) -> list[Measure]:
    return frontal(planned(shot(camera, DEPTH), Focus(distance=FOCUS), radius=radius, views=views))


def _apertures() -> Iterator[Case]:
    run = "frontal plane, closed form"
    for radius in (0.0, -1.0, np.nan, np.inf):
        yield Case(f"aperture radius {radius:g}", "plan", partial(_aperture, radius), "refused")
    for radius in (5e-324, 1e-300, 1e-12, 0.01, 1.0):
        yield Case(f"aperture radius {radius:g}", run, partial(_aperture, radius))
    for times in (1, 10, 1e3, 1e300):
        expected = "right" if times <= 10 else "refused"
        name = f"aperture radius {times:g} scene sizes"
        yield Case(name, run, partial(_aperture, times * SCENE_SIZE), expected)
        check = partial(own_mesh, shot(), radius=times * SCENE_SIZE)
        yield Case(f"{name}, slanted plane", "float64 renderer", check, expected)
        check = partial(own_mesh, shot(), radius=times * SCENE_SIZE, method="thesis")
        yield Case(f"{name}, thesis", "float64 renderer", check, expected)
    for size in ((192, 16), (16, 192)):
        camera = Intrinsics(*size, 80.0, 80.0, size[0] / 2, size[1] / 2)
        name = f"disc wider than a {size[0]}x{size[1]} strip is high"
        yield Case(name, run, partial(_aperture, 12.0, camera=camera))
    for views in (-1, 10**7, 10**12):
        yield Case(f"{views} views", "plan", partial(_aperture, 1.0, views), "refused")
        check = partial(own_mesh, shot(), radius=1.0, views=views, method="thesis")
        yield Case(f"{views} views, thesis", "plan", check, "refused")
    for views in (0, 1, 2, 4096):
        yield Case(f"{views} views", run, partial(_aperture, 1.0, views), cheap=views < 4096)


def _focus_depths(depth: float, focus: Focus, method: str) -> list[Measure]:
    """Focus points of which the first two, or all, are at a depth that is none; the others are the focus."""
    plan = planned(shot(depth=spoilt(depth), frames=(1,)), focus, radius=0.3, method=method)
    expected = float(np.mean([1 / spoilt(depth)[point] for point in focus.points if point >= BAD]))
    error = abs(plan.views.lens.focus / expected - 1)
    return [*folded(plan), Measure(error, "of the focus", 1e-12)]


def _focuses() -> Iterator[Case]:
    rec = shot(depth=DEPTH)
    for distance in (0.0, -1.0, np.nan, 5e-324, 1e-300, 1e-3):
        check = partial(own_mesh, rec, focus=Focus(distance=distance), radius=0.3)
        yield Case(f"focus distance {distance:g}", "plan", check, "refused")
    for distance in (np.inf, 1e300, 1e12):

        def far(distance: float = distance) -> list[Measure]:
            return frontal(planned(shot(depth=DEPTH), Focus(distance=distance), radius=1.0), focus=0.0)

        yield Case(f"focus distance {distance:g}", "frontal plane, closed form", far)
        check = partial(own_mesh, shot(), focus=Focus(distance=distance))
        yield Case(f"focus distance {distance:g}, blur 0.05", "aperture, float64 renderer", check)
    four, mixed = Focus(points=(0, 1, 2, 3)), Focus(points=(0, 1, 50, 70))
    for depth in (0.0, -0.0, -3.0, -1e-300, 1e-300, 1e-12, np.nan, np.inf):
        for method in ("features", "thesis"):
            check = partial(_focus_depths, depth, four, method)
            yield Case(f"all focus points at depth {depth:g}, {method}", "plan", check, "refused")
            check = partial(_focus_depths, depth, mixed, method)
            yield Case(f"two of four focus points at depth {depth:g}, {method}", "float64 renderer", check)
    yield Case("no focus", "plan", partial(own_mesh, rec, focus=Focus(), radius=0.3), "refused")
    check = partial(own_mesh, rec, focus=Focus(points=(1, 10**6)), radius=0.3)
    yield Case("a focus point that does not exist", "plan", check, "refused")


def _wide_lens(height: int, width: int = WIDE) -> Intrinsics:
    return Intrinsics(width, height, 0.85 * width, 0.85 * width, width / 2, height / 2)


def _planned_wide() -> list[Measure]:
    lens = _wide_lens(9000)
    plan = planned(shot(lens, xy=places(lens, 3000)), radius=0.1, views=4)
    return vertices(plan)


def _drawn_wide(height: int, slope: float) -> list[Measure]:
    lens = _wide_lens(height)
    # Source, its upload, three targets, the result and what compares them.
    needed = 300 * lens.width * lens.height
    if needed > _free_memory():
        raise UserError(f"{needed / 2**30:.1f} GiB of memory are needed; run this on a larger machine")
    if slope:
        return _one_triangle(1.0, slope, 0.2, lens)
    return frontal(planned(shot(lens, DEPTH), Focus(distance=FOCUS), radius=0.2, views=4))


def _free_memory() -> float:
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return next(1024.0 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable"))
    except (OSError, StopIteration):
        return float("inf")


def _wide_frames() -> Iterator[Case]:
    run = "float32 vertices against float64, 3000 features"
    yield Case(f"{WIDE}x9000", run, _planned_wide)
    for height in (16, 1000):
        cheap = height < 1000
        name = f"{WIDE}x{height}"
        yield Case(
            f"{name}, frontal plane", "4 views, closed form", partial(_drawn_wide, height, 0.0), cheap=cheap
        )
        check = partial(_drawn_wide, height, 3e-6)
        yield Case(f"{name}, slanted plane", "16 views, closed form", check, cheap=cheap, seconds=180)
    lens = _wide_lens(16, 10**5)
    yield Case("100000x16", "draw", partial(_aperture, 1e-3, 1, lens), "refused")


def _middle(blur: float) -> list[Measure]:
    """The plane itself, not the plan's mesh, where the carried-on border is not seen.

    Depths may be off by what is taken to be in focus: a disc of 1/1500 of the diagonal.
    """
    plan = planned(shot(), blur=blur)
    slope = (1 / FAR - 1 / NEAR) / LENS.width
    centre = (1 / FAR + 1 / NEAR) / 2
    shown = plane_places(LENS, centre, (slope, 0.0), plan.views.lens.focus, plan.views.offsets)
    expected, mean = plane_picture(shown, map_picture(*SIZE)), draw(plan)
    inside = np.s_[16:-16, 24:-24]
    return [
        pixels(displacement_error(mean[inside], expected[inside], SIZE), np.hypot(*SIZE) / 1500 / 2),
        decibels(psnr(mean[inside], expected[inside])),
    ]


def _precision() -> Iterator[Case]:
    for blur, method in itertools.product((0.02, 0.1, 0.5), ("features", "thesis")):
        run = "16 views, float64 renderer"
        yield Case(f"blur {blur:g}, {method}", run, partial(own_mesh, shot(), blur=blur, method=method))
    for scale, times in itertools.product((1e-6, 1.0, 1e6), (0.0, 1e7)):

        def displaced(scale: float = scale, times: float = times) -> list[Measure]:
            return vertices(planned(moved(shot(), scale, times * scale * SCENE_SIZE)))

        yield Case(f"float32 vertices, scale {scale:g}, origin {times:g} off", "against float64", displaced)
    for blur in (0.05, 0.2):
        yield Case(
            f"blur {blur:g}, middle of the picture", "slanted plane, closed form", partial(_middle, blur)
        )
    for near in (1e-1, 1e-2, 1e-3):

        def cancelling(near: float = near) -> list[Measure]:
            # A plane a thousandth behind the focal plane, both so near that the registration is large.
            plan = planned(shot(depth=near * 1.001), Focus(distance=near), radius=50 * near)
            return [*vertices(plan), *frontal(plan, near * 1.001, 1 / near)]

        yield Case(f"focus at {near:g}, radius 50 times that", "closed form, float32 vertices", cancelling)


def _round_trip(camera: Intrinsics) -> list[Measure]:
    canvas, picture = Canvas(camera), map_picture(camera.width, camera.height)
    back = canvas.to_source(canvas.from_source(picture))
    inside = np.s_[4:-4, 4:-4]
    # Two resamplings at OpenCV's steps of 1/32 pixel.
    return [
        pixels(displacement_error(back[inside], picture[inside], (camera.width, camera.height)), 0.1),
        decibels(psnr(back[inside], picture[inside]), 40),
    ]


def _distorted_views(camera: Intrinsics) -> list[Measure]:
    plan = planned(shot(camera), radius=1e-9)
    size = camera.width, camera.height
    source = map_picture(*size)
    mean = gpu_views.mean_of_views(*plan.painted(plan.views.canvas.from_source(source)))
    inside = np.s_[4:-4, 4:-4]
    back = plan.views.canvas.to_source(mean)[inside]
    return [pixels(displacement_error(back, source[inside], size), 0.1)]


def _inverted(camera: Intrinsics) -> list[Measure]:
    """Of rays far past where the lens folds: what is found must be an inverse, the rest no number."""
    x, y = np.meshgrid(np.linspace(-3, 3, 61), np.linspace(-3, 3, 61))
    rays = np.stack([x, y], axis=-1)
    found = camera.undistort(rays)
    lost = np.isnan(found).any(axis=-1)
    error = np.abs(camera.distort(found[~lost]) - rays[~lost]).max() * LENS.fx
    return [pixels(float(error), 1e-6), Measure(float(lost.mean()), "of the rays lost", 1.0)]


def _distortions() -> Iterator[Case]:
    narrow = replace(LENS, fx=160.0, fy=160.0)
    tele = replace(LENS, fx=260.0, fy=260.0)
    kinds: dict[str, tuple[Intrinsics, str]] = {
        "k1 -0.2": (replace(LENS, k1=-0.2), "right"),
        "k1 -0.5, tele": (replace(tele, k1=-0.5), "right"),
        "k1 -0.5, 33 degrees": (replace(narrow, k1=-0.5), "right"),
        "k1 -0.5, 62 degrees": (replace(LENS, k1=-0.5), "refused"),
        "k1 +0.5, 62 degrees": (replace(LENS, k1=0.5), "right"),
        "k1 +0.5, 100 degrees": (replace(LENS, fx=40.0, fy=40.0, k1=0.5), "right"),
        "k1 -1, 62 degrees (folds)": (replace(LENS, k1=-1.0), "refused"),
        "k1 -1, 100 degrees (folds)": (replace(LENS, fx=40.0, fy=40.0, k1=-1.0), "refused"),
        "k1 -1, k2 0.3 (folds and unfolds)": (replace(LENS, k1=-1.0, k2=0.3), "refused"),
        "k2 -1": (replace(LENS, k2=-1.0), "refused"),
        "k1 -0.1, resampled in bands": (Intrinsics(40, 600, 500.0, 500.0, 20.0, 300.0, k1=-0.1), "right"),
        "p1 0.3": (replace(LENS, p1=0.3), "either"),
        "p1 0.01, p2 -0.01": (replace(LENS, p1=0.01, p2=-0.01), "right"),
        "k1 1e300": (replace(LENS, k1=1e300), "refused"),
        "k1 -1e300": (replace(LENS, k1=-1e300), "refused"),
        "k1 nan": (replace(LENS, k1=np.nan), "refused"),
        "k1 1e-300": (replace(LENS, k1=1e-300), "right"),
    }
    for name, (lens, expected) in kinds.items():
        yield Case(name, "to the canvas and back", partial(_round_trip, lens), expected)
        yield Case(f"{name}, views", "plan, 16 views, back", partial(_distorted_views, lens), expected)
    for k1 in (-1.0, -0.5, 0.5):
        check = partial(_inverted, replace(LENS, k1=k1))
        yield Case(f"k1 {k1:g}, rays past the fold", "undistort", check)
