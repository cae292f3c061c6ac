"""Effects of the lens against the mean of 4,096 views: `python -m benchmarks.special lens`.

A frame of the sample clip is drawn by the product, with its own number of views, and once as the reference:
each of 4,096 plain views is drawn alone, without a prefilter and with its lamps as pixels, is warped as a
picture and weighted, and all are averaged. So the reference has neither the shader's polynomials nor the
lamps' discs, and its formulas are written in another form, by directions. With `--page` the frame is drawn
under ten presets of lenses, and crops of it under each effect, for docs/lens.md.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import Floats, LinearRGBA, Map
from addon.core.focus.focus import Focus, radius_for_blur
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.detail import resized
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.highlights import RESTORED, HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.frame.vignetting import LEAST_LEFT
from addon.core.media.clip import open_footage
from addon.core.media.light import encode_srgb
from addon.core.optics.aperture import Aperture
from addon.core.optics.aperture_sampling import exact_registration, vogel_disc
from addon.core.optics.bokeh import bokeh_picture
from addon.core.optics.breathing import enlargement
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import load_solve
from addon.render.views import gpu_views
from addon.render.views.average import render_frame
from addon.ui.focus.bokeh import preset_aperture

from .. import store
from . import metrics

CLIP = store.ROOT / "sample_scenes" / "desk.mp4"
PRESETS = store.ROOT / "addon" / "presets" / "virtual_aperture" / "lens"
PAGE, CROPS = (store.ROOT / "docs" / f"{name}.jpg" for name in ("lenses", "aberrations"))
FRAME, BLUR = 18, 0.05
SIZE = 480, 270
"""Pixels at which it is judged: 4,096 views of the clip's own 640x360 take twelve minutes."""
SUBJECT = 0.52, 0.44
"""Shares of the width and the height at which the globe is: before the wall, behind the mug."""
COUNT, KEPT = 4096, 512
"""Views of the reference, and those whose sums are kept together."""
GRID = 8
"""Pixels between the places at which a view's warp is computed: it is a polynomial of third order."""
SOLVES = 8
"""Steps by which the place is found that a warp maps to a pixel."""
SENSOR = 1.0
"""Width of the sensor in scene units: with it the focus breathes by some per cent."""
COLUMNS, SCALE, LINE, DISCS = 2, 0.75, 20, 112
"""Pictures beside each other on the page, their size, pixels of a name, and of the discs in a corner."""

CROP, PLACES, ENLARGED = (90, 150), ((470, 250), (480, 0)), 2
"""Height and width of a crop, its first column and row for a book and for lamps, and their enlargement."""

Bend = Callable[[float, float, Floats, Floats], tuple[Floats, Floats]]
"""The shift of the ray from (px, py), in aperture radii, at (hx, hy), in half-diagonals, in shares of the
blur radius of infinitely far points."""
Pass = Callable[[float, float, Floats, Floats], Floats]
"""The share of its light that passes at (x, y), in halves of the width and the height."""


def swirl(amount: float) -> Bend:
    """Defocus of the part of a ray that is across the radius of its place."""

    def bend(px: float, py: float, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
        angle = np.arctan2(hy, hx)
        across = amount * (hx**2 + hy**2) * (py * np.cos(angle) - px * np.sin(angle))
        return -across * np.sin(angle), across * np.cos(angle)

    return bend


def coma(length: float) -> Bend:
    """Each zone of the aperture makes a circle, twice round, and the farther away the wider the zone."""

    def bend(px: float, py: float, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
        size = length / 3 * np.hypot(hx, hy) * (px**2 + py**2)
        angle, turn = np.arctan2(hy, hx), 2 * np.arctan2(py, px)
        return size * (2 * np.cos(angle) + np.cos(turn - angle)), size * (
            2 * np.sin(angle) + np.sin(turn - angle)
        )

    return bend


def curved(amount: float) -> Bend:
    """Defocus with the square of the radius."""

    def bend(px: float, py: float, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
        return amount * np.hypot(hx, hy) ** 2 * px, amount * np.hypot(hx, hy) ** 2 * py

    return bend


def sideways(amount: float) -> Bend:
    """Defocus of the horizontal."""
    return lambda px, py, hx, hy: (amount * px + 0 * hx, 0 * (py + hy))


def both(one: Bend, other: Bend) -> Bend:
    """The sum of two bends."""

    def bend(px: float, py: float, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
        (ax, ay), (bx, by) = one(px, py, hx, hy), other(px, py, hx, hy)
        return ax + bx, ay + by

    return bend


def straight(px: float, py: float, hx: Floats, hy: Floats) -> tuple[Floats, Floats]:
    """No shift."""
    return 0 * hx, 0 * hy


def open_aperture(px: float, py: float, x: Floats, y: Floats) -> Floats:
    """All light."""
    return np.ones_like(x)


def boxed(sides: float, top: float) -> Pass:
    """A square opening around the aperture, seen from the side."""
    return lambda px, py, x, y: np.asarray(
        (np.abs(px + sides * x) < 1) & (np.abs(py + top * y) < 1), np.float64
    )


@dataclass(frozen=True)
class Effect:
    """A setting, and how rays know it."""

    aperture: Aperture
    bend: Bend = straight
    passes: Pass = open_aperture


EFFECTS = {
    "off": Effect(Aperture()),
    "swirl 0.5": Effect(Aperture(swirl=0.5), swirl(0.5)),
    "field curvature 0.3": Effect(Aperture(field_curvature=0.3), curved(0.3)),
    "coma 0.2": Effect(Aperture(coma=0.2), coma(0.2)),
    "anamorphic focus 0.1": Effect(Aperture(anamorphic_focus=0.1), sideways(0.1)),
    "lateral color 0.002": Effect(Aperture(lateral_colour=0.002)),
    "matte box 0.5, 0.3": Effect(
        Aperture(matte_box_sides=0.5, matte_box_top=0.3), passes=boxed(0.5, 0.3)
    ),
    "breathing 0.2": Effect(Aperture(breathing=0.2)),
    "swirl 0.5, coma 0.2, matte box 0.5": Effect(
        Aperture(swirl=0.5, coma=0.2, matte_box_sides=0.5), both(swirl(0.5), coma(0.2)), boxed(0.5, 0.0)
    ),
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=COUNT, help="of the reference")
    parser.add_argument("--only", nargs="*", default=list(EFFECTS), metavar="EFFECT", help="a part of them")
    parser.add_argument("--page", action="store_true", help="draw the pictures of docs/lens.md instead")
    arguments = parser.parse_args()
    clip, size = sample()
    if arguments.page:
        page(clip, size)
        crops(clip, size)
        return
    lens = options(clip, Aperture())
    plain, spent = timed(clip, lens, SIZE)
    drawn = {name: timed(clip, options(clip, EFFECTS[name].aperture), SIZE) for name in arguments.only}
    true = reference(clip, SIZE, arguments.only, arguments.views)
    print("| effect | dB | off against it, dB | CPU s | CPU s off |\n" + "|---" * 5 + "|")
    folder = store.ROOT / "build" / "lens"
    folder.mkdir(parents=True, exist_ok=True)
    for name, wished in zip(arguments.only, true, strict=True):
        picture, seconds = drawn[name]
        scores = [metrics.psnr(inner(one), inner(wished)) for one in (picture, plain)]
        print(f"| {name} | " + " | ".join(f"{each:.1f}" for each in scores), end="")
        print(f" | {seconds:.2f} | {spent:.2f} |", flush=True)
        pair = np.hstack([shown(picture), shown(wished)])
        cv2.imwrite(str(folder / f"{name.replace(' ', '_')}.png"), pair[..., ::-1])


def sample() -> tuple[ClipContext, tuple[int, int]]:
    """The sample clip, solved and kept in the benchmark's folder, and its (width, height)."""
    work = store.FOLDER / "solves" / f"desk-{store.digest(store.sources(*store.SOLVER))}.aperture"
    if not work.exists():
        SolveProcess(CLIP, work).wait()
    reconstruction, footage = load_solve(work).reconstruction, open_footage(CLIP)
    height, width = footage.read(FRAME).shape[:2]
    return ClipContext(reconstruction, footage.read), (width, height)


def subject(clip: ClipContext) -> float:
    """Return the distance of the globe."""
    canvas = clip.reconstruction.canvas(clip.reconstruction.image_at(FRAME)[0])
    inverse = clip.depth(FRAME, canvas, clip.picture(FRAME, RESTORED)).inverse_depth
    column, row = (int(share * n) for share, n in zip(SUBJECT, inverse.shape[::-1], strict=True))
    return float(1 / inverse[row, column])


def options(clip: ClipContext, aperture: Aperture) -> FrameOptions:
    """The lens, focused on the globe."""
    focus = Focus(distance=subject(clip))
    radius = radius_for_blur(clip.reconstruction, focus, FRAME, BLUR)
    return FrameOptions(focus, radius, aperture=aperture, grain=0.0, sensor=SENSOR)


def timed(clip: ClipContext, lens: FrameOptions, size: tuple[int, int]) -> tuple[LinearRGBA, float]:
    """The frame, and the CPU seconds that it takes the second time, when depth is known."""
    for _ in range(2):
        began = time.process_time()
        picture = render_frame(clip, FRAME, lens, size, lambda note: None)
    return picture, time.process_time() - began


def reference(clip: ClipContext, size: tuple[int, int], names: list[str], count: int) -> list[LinearRGBA]:
    """Return each effect's mean of a number of plain views, warped and weighted one by one.

    Sums of some views are kept, so that a run that was ended goes on.
    """
    lens = options(clip, Aperture())
    places = vogel_disc(count)
    code = store.digest(store.sources("addon/core", "addon/render", "benchmarks/accuracy/lens.py"))
    total = np.zeros((len(names), size[1], size[0], 5))
    for part in np.array_split(places, -(-count // KEPT)):
        key = store.digest(code, size, names, part)
        total += store.kept("lens", key, partial(_sums, clip, size, names, part))
    found = total[..., :4] / np.maximum(total[..., 4:], 1e-9)
    found /= np.maximum(found[..., 3:], LEAST_LEFT)
    return [
        finished(np.asarray(mean, np.float32), EFFECTS[name].aperture, clip, lens)
        for mean, name in zip(found, names, strict=True)
    ]


def _sums(clip: ClipContext, size: tuple[int, int], names: list[str], places: Floats) -> Map:
    """Return the sums (n, H, W, 5) of views from places (k, 2): their weighted light, and the weights."""
    lens = options(clip, Aperture())
    by_views = replace(lens, highlights=HighlightSettings(gain=0.0), sensor=0.0)
    picture = resized(clip.picture(FRAME, lens.highlights), size)
    warped = mesh_frame(clip, FRAME, by_views, size, picture).through(1, prefiltered=False)
    views = warped.views
    infinity = views.lens.radius * views.canvas.pinhole.fx * views.lens.axis
    middle = views.canvas.pinhole.principal_point
    warps = [_Warp(EFFECTS[name], middle, size, infinity) for name in names]
    for px, py in places:
        offsets = views.lens.radius * np.array([[px, py]])
        registration = exact_registration(views.canvas, offsets, views.lens.focus)
        one = replace(views, offsets=offsets, registration=registration, weights=None)
        view = gpu_views.mean_of_views(one, warped.layers)
        for warp in warps:
            warp.add(view, float(px), float(py))
    return np.asarray([np.dstack([warp.sum, warp.light]) for warp in warps], np.float32)


class _Warp:
    """The weighted sum of the views of an effect."""

    def __init__(self, effect: Effect, middle: Floats, size: tuple[int, int], infinity: float) -> None:
        self._effect, self._size, self._infinity = effect, size, infinity
        self._half = float(np.hypot(*size)) / 2
        width, height = size
        cells = -(-width // GRID), -(-height // GRID)
        x, y = ((np.arange(n) + 0.5) * whole / n for n, whole in zip(cells, size, strict=True))
        self._x, self._y = np.meshgrid(x - middle[0], y - middle[1])
        self.sum = np.zeros((height, width, 4), np.float64)
        self.light = np.zeros((height, width))
        far = np.meshgrid(np.arange(width) + 0.5 - middle[0], np.arange(height) + 0.5 - middle[1])
        self._places = far[0] / (width / 2), far[1] / (height / 2)
        self._pixels = far[0] + middle[0], far[1] + middle[1]

    def add(self, view: LinearRGBA, px: float, py: float) -> None:
        """Add the view from a place on the aperture."""
        if self._effect.bend is not straight:
            view = self._warped(view, px, py)
        if self._effect.passes is open_aperture:
            self.sum += view
            self.light += 1
            return
        light = self._effect.passes(px, py, *self._places)
        self.sum += light[..., None] * view
        self.light += light

    def _warped(self, view: LinearRGBA, px: float, py: float) -> LinearRGBA:
        x, y = self._x, self._y
        for _ in range(SOLVES):
            dx, dy = self._effect.bend(px, py, x / self._half, y / self._half)
            x, y = self._x - self._infinity * dx, self._y - self._infinity * dy
        maps = (self._upsampled(each) for each in (x - self._x, y - self._y))
        at = [
            (whole + moved - 0.5).astype(np.float32)
            for whole, moved in zip(self._pixels, maps, strict=True)
        ]  # fmt: skip
        return np.asarray(
            cv2.remap(view, at[0], at[1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT), np.float32
        )

    def _upsampled(self, values: Floats) -> Map:
        return np.asarray(cv2.resize(values.astype(np.float32), self._size, interpolation=cv2.INTER_CUBIC))


def finished(mean: LinearRGBA, aperture: Aperture, clip: ClipContext, lens: FrameOptions) -> LinearRGBA:
    """Enlarge a mean by breathing, and its red and blue by lateral color."""
    camera = clip.reconstruction.image_at(FRAME)[0].camera
    own = clip.reconstruction.cameras[camera]
    factor = 1.0
    if aperture.breathing:
        assert lens.focus.distance is not None
        factor = enlargement(
            aperture.breathing,
            SENSOR * own.fx / own.width,
            1 / lens.focus.distance,
            1 / clip.reconstruction.typical_depth,
        )
    larger = factor * np.array([1 + aperture.lateral_colour, 1.0, 1 - aperture.lateral_colour, 1.0])
    size = mean.shape[1], mean.shape[0]
    middle = own.principal_point * size / [own.width, own.height] - 0.5
    channels = []
    for channel, scale in enumerate(larger):
        back = np.column_stack([np.eye(2) / scale, middle - middle / scale])
        flags = cv2.INTER_LANCZOS4 | cv2.WARP_INVERSE_MAP
        one = np.ascontiguousarray(mean[..., channel])
        channels.append(
            one if scale == 1 else cv2.warpAffine(one, back, size, flags=flags, borderMode=cv2.BORDER_REFLECT)
        )
    return np.asarray(np.maximum(np.dstack(channels), 0), np.float32)


def inner(picture: LinearRGBA) -> Map:
    """Return (h, w, 3) without a border of a fiftieth, where the reference's views see nothing."""
    edge = picture.shape[1] // 50
    return picture[edge:-edge, edge:-edge, :3]


def shown(picture: LinearRGBA) -> NDArray[np.uint8]:
    """Return (H, W, 3) of 255, as displayed."""
    return np.asarray(np.rint(255 * encode_srgb(np.clip(picture[..., :3], 0, 1))), np.uint8)


def page(clip: ClipContext, size: tuple[int, int]) -> None:
    """Draw the frame under the presets of lenses, all with one amount of blur, and write the page."""
    made = []
    for file in sorted(PRESETS.glob("[0-9]*.py"), key=lambda file: file.stem):
        aperture = preset_aperture(file)
        lens = replace(options(clip, aperture), sensor=0.0)
        picture = render_frame(clip, FRAME, lens, size, lambda note: None)
        small = cv2.resize(shown(picture), None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_AREA)
        named(small, file.stem.replace("_slash_", "/").replace("_", " "))
        small[-LINE - DISCS : -LINE, -DISCS:] = np.rint(255 * encode_srgb(bokeh_picture(aperture, DISCS)))
        made.append(small)
    write_rows(made, COLUMNS, PAGE)


def crops(clip: ClipContext, size: tuple[int, int]) -> None:
    """Draw two places of the frame under each effect alone, and write them side by side."""
    made = []
    for name in list(EFFECTS)[:-1]:
        picture = shown(
            render_frame(clip, FRAME, options(clip, EFFECTS[name].aperture), size, lambda note: None)
        )
        height, width = CROP
        parts = [picture[y : y + height, x : x + width] for x, y in PLACES]
        cell = cv2.resize(np.vstack(parts), None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)
        made.append(named(np.asarray(cell, np.uint8), name))
    write_rows(made, len(made) // 2, CROPS)


def named(picture: NDArray[np.uint8], name: str) -> NDArray[np.uint8]:
    """Write a name over the last lines of a picture (H, W, 3), in place."""
    picture[-LINE:] //= 4
    at = 8, picture.shape[0] - LINE // 4
    cv2.putText(picture, name, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
    return picture


def write_rows(pictures: list[NDArray[np.uint8]], columns: int, out: Path) -> None:
    """Write pictures (H, W, 3) of one size in rows as a JPEG."""
    rows = [np.hstack(pictures[n : n + columns]) for n in range(0, len(pictures), columns)]
    cv2.imwrite(str(out), np.vstack(rows)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])
    print(f"{out}: {len(pictures)} pictures, {out.stat().st_size / 1000:.0f} kB")
