"""Frames drawn as the product draws them, whose digests are kept in `frame_digests.json`.

`python -m tests.frame.frame_digests` draws all frames, prints the seconds of each and whether it changed;
`--write` keeps the new digests, `--pictures FOLDER` writes the pictures. The real clips are those of
`VA_DATA`; their cameras and points in `frame_solves.npz` are of solves of 24 frames at 640 pixels.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import platform
import re
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import bpy
import cv2
import gpu
import numpy as np

from addon.core.base.arrays import LinearRGBA, Map
from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction
from addon.core.depth.map_fusion import FusionOptions
from addon.core.depth.source import DepthSource, PixelDepth
from addon.core.depth.user_depth import UserDepth
from addon.core.depth.user_maps import open_depth
from addon.core.focus.focus import Focus
from addon.core.frame.cg_layers import CGObjects
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Frame
from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.plan import FrameOptions
from addon.core.frame.quality import NORMAL
from addon.core.frame.range_matte import Range
from addon.core.frame.repairs import Repair
from addon.core.media.clip import open_footage
from addon.core.media.light import encode_srgb
from addon.core.optics.aperture import Aperture
from addon.core.warp.cg_layer import CGLayer
from addon.render.views.average import draw_matte, draw_shares, render_frame
from addon.render.views.quiet import quiet
from sample_scenes import filming, staging, truth

from ..conftest import DATA

HERE = Path(__file__).parent
CPU = Path("/proc/cpuinfo")
FILE, SOLVES = HERE / "frame_digests.json", HERE / "frame_solves.npz"
SIZE = (192, 108)
"""Pixels of the sample scenes."""
WIDTH = 192
"""Pixels of the real clips across."""
AROUND, LONGER = 1, 3
"""Frames of a clip before and after the drawn one, and of the one whose path is steadied."""
SAMPLES = 4
"""Cycles' samples a pixel of the sample scenes."""
DISC = 12.0
"""Diameter in pixels of the blur disc of infinitely far points."""
FEW = FusionOptions(step=1, sides=1)
SUBJECTS = replace(NORMAL, name="subjects", stereo_side=WIDTH, fusion=FEW)
QUICK = replace(SUBJECTS, name="quick", finds_subjects=False)
SMALL = replace(QUICK, name="small", longest=WIDTH // 2, better=NORMAL)
LENS = FrameOptions(Focus(), 0.0, quality=QUICK, views=16, highlights=HighlightSettings(0.0), grain=0.0)
"""Without every effect."""


@dataclass(frozen=True)
class Clip:
    """A clip of a few frames, with what a case may have besides."""

    context: ClipContext
    frame: int
    """The drawn one, in the middle."""
    near: float
    """Distance of the focal plane, in the reconstruction's unit."""
    mask: Callable[[int], Map | None] = lambda frame: None
    true_depth: DepthSource | None = None
    maps: DepthSource | None = None

    @property
    def camera(self) -> Intrinsics:
        """That of the drawn frame."""
        return self.context.canvas(self.frame).camera


@dataclass(frozen=True)
class Case:
    """A frame of a clip, and what is drawn of it."""

    clip: str
    """A key of `SOLVED` or one of `STAGES`."""
    lens: dict[str, Any] = field(default_factory=dict)
    """Fields of `FrameOptions` that differ from `LENS`."""
    context: Callable[[Clip], dict[str, Any]] = lambda clip: {}
    """Returns the fields of `ClipContext` that the case adds."""
    tilt: dict[str, float] = field(default_factory=dict)
    """Other fields of `Focus`."""
    points: int = 0
    """Number of points in focus."""
    cg: Callable[[Clip, Canvas], CGObjects] | None = None
    shows: Callable[[Frame], LinearRGBA | Map] | None = None
    """What is drawn with the frame, in its place."""


@dataclass(frozen=True)
class True3D(DepthSource):
    """The depth of a sample scene's surfaces."""

    depth: Callable[[int], Map]

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> PixelDepth:
        size = canvas.pinhole.width, canvas.pinhole.height
        return PixelDepth(1 / cv2.resize(self.depth(frame), size, interpolation=cv2.INTER_NEAREST))


def real(name: str) -> Clip:
    """A real clip, with cameras and points that were solved once."""
    with np.load(SOLVES) as stored:
        kept = {key.partition("/")[2]: stored[key] for key in stored.files if key.startswith(name + "/")}
    camera = Intrinsics(*map(int, kept["size"]), *map(float, kept["camera"]))
    small = camera.scaled(WIDTH, round(WIDTH * camera.height / camera.width))
    zoom, ends = small.width / camera.width, np.cumsum(kept["counts"])[:-1]
    parts = zip(
        kept["frames"], kept["rotations"], kept["translations"], np.split(kept["xy"], ends),
        np.split(kept["points"], ends), strict=True,
    )  # fmt: skip
    images = tuple(Image(int(f), r, t, zoom * xy.astype(np.float64), ids) for f, r, t, xy, ids in parts)
    if name != GARDEN:
        images = images[LONGER - AROUND : LONGER + AROUND + 1]
    xyz = kept["xyz"].astype(np.float64)
    points = Points(xyz, np.full((len(xyz), 3), 128, np.uint8), np.full(len(xyz), 0.5))
    readout = float(kept["readout"][0]), float(kept["readout"][1])
    reconstruction = Reconstruction((small,), images, points, readout=readout)
    (file,) = (DATA / "clips").glob(f"{name}.*")
    footage = open_footage(file)

    @cache
    def read(frame: int) -> np.ndarray:
        return cv2.resize(
            footage.read(frame)[..., :3], (small.width, small.height), interpolation=cv2.INTER_AREA
        )

    def mask(frame: int) -> Map | None:
        held = cv2.imread(str(DATA / "masks" / name / f"{frame - 1:05d}.png"), cv2.IMREAD_GRAYSCALE)
        return None if held is None else held.astype(np.float32) / 255

    context = ClipContext(reconstruction, read)
    return Clip(context, int(kept["frames"][LONGER]), 0.7 * reconstruction.typical_depth, mask)


def staged(name: str) -> Clip:
    """A sample scene, with its true cameras, depth and masks; its folder is removed at the end."""
    stage = filming.load(name)
    middle = len(stage.cameras) // 2
    stage = stage.cut(slice(middle - AROUND, middle + AROUND + 1))
    stage = replace(stage, cameras=stage.cameras.resized(*SIZE))
    folder = Path(FOLDER.name) / name
    scene, frames = staging.build(stage, SAMPLES), range(1, 2 * AROUND + 2)
    with quiet(1):
        filming.film(stage, scene, folder / "clip", SAMPLES)
        seen = {frame: truth.geometry(scene, frame) for frame in frames}
    (folder / "maps").mkdir()
    for frame, found in seen.items():
        scaled = (60000 * found.depth[np.isfinite(found.depth)].min() / found.depth).astype(np.uint16)
        cv2.imwrite(str(folder / "maps" / f"map_{frame:04d}.png"), scaled)
    frame, footage = AROUND + 1, open_footage(folder / "clip")
    reconstruction = with_points(filming.true_cameras(stage.cameras), frame, seen[frame].depth)
    moving = [number for number, thing in enumerate(stage.things) if thing.subject or thing.moves]
    return Clip(
        ClipContext(reconstruction, footage.read), frame, 0.7 * reconstruction.typical_depth,
        lambda each: np.isin(seen[each].thing, moving).astype(np.float32),
        True3D(lambda each: seen[each].depth),
        UserDepth.of(open_depth(folder / "maps", footage), reconstruction),
    )  # fmt: skip


def with_points(cameras: Reconstruction, frame: int, depth: Map) -> Reconstruction:
    """Add points on the surfaces that a frame sees, of depth (H, W)."""
    camera, (image, _) = cameras.cameras[0], cameras.image_at(frame)
    y, x = np.mgrid[6 : SIZE[1] : 9, 6 : SIZE[0] : 9].reshape(2, -1)
    places = np.column_stack([x, y])[np.isfinite(depth[y, x])]
    z = depth[places[:, 1], places[:, 0]]
    rays = (places + 0.5 - camera.principal_point) / camera.focal
    xyz = (np.column_stack([rays, np.ones(len(z))]) * z[:, None] - image.translation) @ image.rotation
    images = []
    for each in cameras.images:
        local = each.to_camera(xyz)
        xy = camera.project(local)
        ids = np.nonzero((local[:, 2] > 0) & np.all((xy > 0) & (xy < SIZE), axis=1))[0]
        images.append(replace(each, xy=xy[ids], points=ids.astype(np.int32)))
    points = Points(xyz, np.full((len(z), 3), 128, np.uint8), np.full(len(z), 0.5))
    return replace(cameras, images=tuple(images), points=points)


def ball(
    clip: Clip, canvas: Canvas, far: float, place: tuple[float, float], is_sharp: bool = False
) -> CGLayer:
    """A round CG object at a multiple of the focal distance, at shares of the picture, half transparent."""
    width, height = canvas.pinhole.width, canvas.pinhole.height
    y, x = np.mgrid[:height, :width] + 0.5
    away = np.hypot(x - place[0] * width, y - place[1] * height)
    alpha = np.clip(0.12 * width - away, 0, 1).astype(np.float32) * np.float32(0.8 if far > 1 else 1.0)
    picture = np.dstack([0.9 * alpha, 0.3 * alpha, 0.1 * alpha, alpha]).astype(np.float32)
    inverse = np.full(alpha.shape, 1 / (far * clip.near), np.float32)
    layer = CGLayer.of(picture, inverse, 0, 0.0, is_sharp)
    assert layer is not None
    return layer


def objects(clip: Clip, canvas: Canvas) -> CGObjects:
    """One ball before the focal plane and one behind it, and a shadow."""
    width, height = canvas.pinhole.width, canvas.pinhole.height
    shadow = np.ones((height, width, 3), np.float32)
    shadow[height // 2 :, : width // 3] = 0.6
    return CGObjects((ball(clip, canvas, 0.7, (0.3, 0.4)), ball(clip, canvas, 1.6, (0.65, 0.5))), shadow)


def title(clip: Clip, canvas: Canvas) -> CGObjects:
    """A ball that stays sharp."""
    return CGObjects((ball(clip, canvas, 1.6, (0.5, 0.5), is_sharp=True),))


def masks(clip: Clip) -> dict[str, Any]:
    return {"masks": clip.mask}


def maps(clip: Clip) -> dict[str, Any]:
    return {"maps": clip.maps}


def given(clip: Clip) -> dict[str, Any]:
    return {"given_depth": clip.true_depth}


STROKE = ((0.45, 0.5), (0.6, 0.55))
"""Over the middle of a picture."""
GARDEN, DANCE, NIGHT = "still_garden_shaky_1", "person_dance_davis_1", "night_walker"
GLIDER, DOG = "paraglider", "dog"
LAMPS = HighlightSettings(1.0)
BENT = Aperture(swirl=0.6, coma=0.4, lateral_colour=0.01)
CASES = {
    "layers mesher": Case(GARDEN),
    "features mesher": Case(GARDEN, {"method": "features"}),
    "thesis mesher": Case(GARDEN, {"method": "thesis"}, points=12),
    "steadied": Case(GARDEN, {"stabilize": 1.0}),
    "steadied, border filled": Case(GARDEN, {"stabilize": 1.0, "fill_border": True}),
    "steadied features": Case(GARDEN, {"stabilize": 0.5, "method": "features"}),
    "steadied CG objects": Case(GARDEN, {"stabilize": 1.0}, cg=objects),
    "grain": Case(GARDEN, {"grain": 1.0}),
    "moving subjects found": Case(DANCE, {"quality": SUBJECTS}),
    "masks": Case(DANCE, {}, masks),
    "a repair nearer": Case(DANCE, {"repairs": (Repair("nearer", 0, STROKE, 0.06),)}, masks),
    "highlights": Case(NIGHT, {"highlights": LAMPS}),
    "highlights through features": Case(NIGHT, {"highlights": LAMPS, "method": "features"}),
    "highlights with aberrations": Case(NIGHT, {"highlights": LAMPS, "aperture": BENT}),
    "cat's eyes and colour fringes": Case(
        NIGHT, {"aperture": Aperture(blades=6, vignetting=0.5, axial_colour=0.05), "highlights": LAMPS}
    ),
    "thin lines with masks": Case(GLIDER, {}, masks),
    "masks followed": Case(GLIDER, {"quality": SUBJECTS}, masks),
    "draft with detail": Case(GLIDER, {"quality": SMALL, "views": 0}),
    "zone in focus": Case(
        DOG, {"borrow": False, "zone_front": 0.2, "zone_behind": 0.3, "blur_in_front": 0.5}
    ),
    "breathing": Case(DOG, {"borrow": False, "sensor": 0.036, "aperture": Aperture(breathing=1.0)}),
    "sharp title": Case("bars", {}, given, cg=title),
    "CG objects": Case("bars", {}, given, cg=objects),
    "CG objects, detail, grain": Case("bars", {"quality": SMALL, "grain": 1.0}, given, cg=objects),
    "aberrations": Case("fence", {"borrow": False, "aperture": BENT}, given),
    "matte box and squeeze": Case(
        "fence", {"borrow": False, "aperture": Aperture(ratio=1.5, matte_box_sides=0.3)}, given
    ),
    "tilted focus": Case("slope", {}, given, {"tilt": 0.5, "swing": 0.2}),
    "field curvature": Case("slope", {"aperture": Aperture(field_curvature=0.5)}, given),
    "depth maps": Case("slope", {}, maps),
    "maps with features": Case("slope", {"method": "features"}, maps),
    "nothing borrowed": Case("foreground", {"borrow": False}, given),
    "repairs": Case(
        "foreground",
        {"repairs": (Repair("same", 0, STROKE, 0.08, reference=(0.2, 0.2)), Repair("soft", 0, STROKE, 0.03))},
        given,
    ),
    "range matte": Case("foreground", {}, given, shows=lambda drawn: draw_matte(drawn, Range(0.0, 4.0))),
    "sources": Case("foreground", {}, given, shows=draw_shares),
    "masks by stereo": Case("stroller", {}, masks),
    "aberrations on a steadier path": Case(
        "stroller", {"stabilize": 1.0, "aperture": BENT, "fill_border": True}, masks, cg=objects
    ),
}
"""By the feature that changed if one differs."""
REAL = tuple(name for name, case in CASES.items() if case.clip in (GARDEN, DANCE, NIGHT, GLIDER, DOG))
FOLDER = tempfile.TemporaryDirectory(prefix="frame-digests-")


@cache
def opened(name: str) -> Clip:
    """A clip, once for all cases."""
    return real(name) if name in (GARDEN, DANCE, NIGHT, GLIDER, DOG) else staged(name)


@cache
def context(name: str, given: Callable[[Clip], dict[str, Any]]) -> ClipContext:
    """The context of a clip, whose depth is found once for all cases with the same masks and maps."""
    clip = opened(name)
    return replace(clip.context, **given(clip))


def drawn(case: Case) -> LinearRGBA | Map:
    """Draw the frame of a case, (h, w, 4) linear, or what it shows instead."""
    clip = opened(case.clip)
    whole, size = context(case.clip, case.context), (clip.camera.width, clip.camera.height)
    camera, near, ids = clip.camera, clip.near, tuple(range(0, 10 * case.points, 10))
    options = replace(
        LENS, focus=Focus(ids, near, **case.tilt), radius=DISC * near / (2 * camera.fx), **case.lens
    )
    options = replace(options, repairs=tuple(replace(each, frame=clip.frame) for each in options.repairs))
    found, cg = list[Frame](), case.cg
    picture = render_frame(
        whole, clip.frame, options, size, lambda note: None, found.append,
        None if cg is None else lambda frame, canvas, depth: cg(clip, canvas),
    )  # fmt: skip
    return picture if case.shows is None else case.shows(found[0])


def digests(picture: LinearRGBA | Map) -> dict[str, str]:
    """Digests of a picture to the bit, and as a screen of 8 bits shows it."""
    shown = np.rint(255 * encode_srgb(np.clip(picture, 0, 1))).astype(np.uint8)
    return {"bits": _digest(np.asarray(picture, np.float32)), "shown": _digest(shown)}


def _digest(values: np.ndarray) -> str:
    return hashlib.sha256(repr(values.shape).encode() + np.ascontiguousarray(values).tobytes()).hexdigest()[
        :16
    ]


def this_platform() -> dict[str, str]:
    """What last bits depend on: the approximate reciprocals of Cycles differ by the maker of a processor."""
    found = re.search(r"model name\s*: (.*)", CPU.read_text()) if CPU.exists() else None
    return {
        "model": found[1] if found else platform.processor(),
        "machine": f"{platform.system()} {platform.machine()}", "blender": bpy.app.version_string,
        "numpy": np.__version__, "opencv": cv2.__version__, "processor": cv2.getCPUFeaturesLine(),
        "gpu": f"{gpu.platform.renderer_get()}, {gpu.platform.version_get()}",
    }  # fmt: skip


def stored() -> dict[str, Any]:
    """The platform and digests of `FILE`."""
    found = json.loads(FILE.read_text())
    assert isinstance(found, dict)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", help="names of cases; all by default")
    parser.add_argument("--write", action="store_true", help="keep the new digests")
    parser.add_argument("--pictures", type=Path, help="folder for the pictures, as .npy and .png")
    arguments = parser.parse_args()
    before = stored()["digests"] if FILE.exists() else {}
    made = dict(before)
    for name in arguments.cases or CASES:
        began, spent = time.perf_counter(), time.process_time()
        picture = drawn(CASES[name])
        made[name] = digests(picture)
        changed = "" if made[name] == before.get(name) else "  changed"
        seconds, spent = time.perf_counter() - began, time.process_time() - spent
        print(f"{name:32} {seconds:6.2f} s, CPU {spent:6.2f} s{changed}", flush=True)
        if arguments.pictures is not None:
            arguments.pictures.mkdir(parents=True, exist_ok=True)
            np.save(arguments.pictures / f"{name}.npy", picture)
            shown = np.rint(255 * encode_srgb(np.clip(picture, 0, 1)))
            cv2.imwrite(
                str(arguments.pictures / f"{name}.png"), shown[..., [2, 1, 0]] if shown.ndim == 3 else shown
            )
    if arguments.write:
        kept = {name: made[name] for name in CASES}
        FILE.write_text(json.dumps({"platform": this_platform(), "digests": kept}, indent=1) + "\n")


if __name__ == "__main__":
    main()
