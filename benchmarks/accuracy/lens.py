"""The pictures of docs/lens.md: `python -m benchmarks.special lens`.

They are a frame of the sample clip under ten presets of lenses, and crops of it under each effect.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.arrays import LinearRGBA
from addon.core.focus.focus import Focus, radius_for_blur
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.highlights import RESTORED
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import open_footage
from addon.core.media.light import encode_srgb
from addon.core.optics.aperture import Aperture
from addon.core.optics.bokeh import bokeh_picture
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import load_solve
from addon.render.views.average import render_frame
from addon.ui.focus.bokeh import preset_aperture

from .. import store

CLIP = store.ROOT / "sample_scenes" / "desk.mp4"
PRESETS = store.ROOT / "addon" / "presets" / "virtual_aperture" / "lens"
PAGE, CROPS = (store.ROOT / "docs" / f"{name}.jpg" for name in ("lenses", "aberrations"))
FRAME, BLUR = 18, 0.05
SUBJECT = 0.52, 0.44
"""Shares of the width and the height at which the globe is: before the wall, behind the mug."""
SENSOR = 1.0
"""Width of the sensor in scene units: with it the focus breathes by some per cent."""
COLUMNS, SCALE, LINE, DISCS = 2, 0.75, 20, 112
"""Pictures beside each other on the page, their size, pixels of a name, and of the discs in a corner."""

CROP, PLACES, ENLARGED = (90, 150), ((470, 250), (480, 0)), 2
"""Height and width of a crop, its first column and row for a book and for lamps, and their enlargement."""

EFFECTS = {
    "off": Aperture(),
    "swirl 0.5": Aperture(swirl=0.5),
    "field curvature 0.3": Aperture(field_curvature=0.3),
    "coma 0.2": Aperture(coma=0.2),
    "anamorphic focus 0.1": Aperture(anamorphic_focus=0.1),
    "lateral color 0.002": Aperture(lateral_colour=0.002),
    "matte box 0.5, 0.3": Aperture(matte_box_sides=0.5, matte_box_top=0.3),
    "breathing 0.2": Aperture(breathing=0.2),
}


def main() -> None:
    """Write both pictures."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    clip, size = sample()
    page(clip, size)
    crops(clip, size)


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
    for name, aperture in EFFECTS.items():
        picture = shown(render_frame(clip, FRAME, options(clip, aperture), size, lambda note: None))
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
