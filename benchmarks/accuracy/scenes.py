"""What the judge needs of a scene: a clip, and what is true of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Protocol

import bpy
import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.base.lru_cache import remembered
from addon.core.camera.reconstruction import Reconstruction
from addon.core.depth.map_fusion import BEYOND, FusionOptions, level_of, past_border
from addon.core.depth.multi_view_stereo import DenseDepth
from addon.core.depth.reprojection import in_place
from addon.core.media.light import decode_srgb, encode_srgb
from addon.core.warp.disocclusion_fill import LONGEST_SIDE
from addon.render.views.quiet import quiet
from sample_scenes import filming, staging, truth
from sample_scenes.stage import Stage

from .. import store
from . import oracle
from .mask_metrics import stroke

Picture = NDArray[np.float32]
Floats = NDArray[np.float64]
Motion = tuple[Floats, NDArray[np.bool_]]

FILM_SAMPLES = 16
SIZE = (480, 270)
"""Pixels of the pictures of `Short`, 9/16 of a sample scene's own."""
FRAMES = 16
"""Of a clip of `Short`."""
BLURS = (0.0125, 0.025, 0.05, 0.1)
"""Largest discs of `Short`, in shares of the width."""
NOISE = 0.02
"""Of the truth of `Short`: Cycles samples every pixel until its error is about this."""


@dataclass(frozen=True)
class Truth:
    """One frame through one lens."""

    picture: Picture
    """(H, W, 3) linear: the mean of two seeds."""
    seeds: tuple[Picture, Picture]
    """The two, for the noise ceiling."""


class Scene(Protocol):
    """A clip with cameras, depth and lens pictures that are true; frames count from 1."""

    @property
    def name(self) -> str: ...

    @property
    def blurs(self) -> tuple[int, ...]:
        """Largest blur discs in pixels that it is judged at."""

    @property
    def cameras(self) -> Reconstruction: ...

    @property
    def key(self) -> str:
        """Changes with everything that the truth depends on."""

    def judged(self, blur: int) -> tuple[int, ...]:
        """Frames that there is truth for, consecutive."""

    def clip(self) -> Path:
        """The folder of the whole clip."""

    def frame(self, frame: int) -> NDArray[np.uint8]:
        """(H, W, 3) of the clip, sRGB."""

    def depth(self, frame: int) -> Floats:
        """(H, W) true depth, inf for infinitely far."""

    def subject(self, frame: int) -> NDArray[np.bool_] | None:
        """(H, W) whose centre shows a person, animal or vehicle that moves; None in a scene without one."""

    def matte(self, frame: int) -> NDArray[np.float32] | None:
        """(H, W) in [0, 1] how much of every pixel those cover; where no frame is judged, 0 or 1."""

    def strokes(self, frame: int) -> dict[str, Floats]:
        """(n, 2) by subject, places of a stroke over it, from head to foot, in shares of the picture."""

    def past_border(self, frame: int) -> NDArray[np.float32] | None:
        """What is `PixelDepth.past_border`, true as far as frames around see it; None where no border is
        judged."""

    def focus_depth(self, frame: int, blur: int) -> float: ...

    def focus_xy(self, frame: int, blur: int) -> Floats:
        """(2,) where the subject is seen, in pixels."""

    def radius(self, blur: int) -> float: ...

    def margin(self, blur: int) -> int:
        """Pixels a side that are not judged, for there is no truth for them."""

    def truth(self, frame: int, blur: int) -> Truth: ...

    def motion(self, frame: int) -> Motion | None:
        """Motion to the next frame and where it is seen there; None where it is not known."""

    def layers(self, frame: int, margin: int) -> oracle.LayeredDepthImage | None:
        """What the oracle is told; None where nobody knows."""


class Staged:
    """A scene that is rendered from code."""

    def __init__(self, name: str, noise: float) -> None:
        self.name = name
        self.noise = noise
        self.blurs: tuple[int, ...] = (8, 16, 32, 64)

    @cached_property
    def stage(self) -> Stage:
        return filming.load(self.name)

    @cached_property
    def key(self) -> str:
        return store.digest(self.folder, store.sources("sample_scenes/filming.py"))

    @cached_property
    def folder(self) -> str:
        """Of what does not depend on how the clip is recorded."""
        code = store.sources("sample_scenes/staging.py", "sample_scenes/truth.py")
        return f"{self.name}-{store.digest(self.stage, code, bpy.app.version_string, FILM_SAMPLES)}"

    @cached_property
    def scene(self) -> bpy.types.Scene:
        return staging.build(self.stage)

    @cached_property
    def cameras(self) -> Reconstruction:
        return filming.true_cameras(self.stage.cameras)

    def judged(self, blur: int) -> tuple[int, ...]:
        middle = len(self.stage.cameras) // 2
        return (middle, middle + 1, middle + 2)

    def clip(self) -> Path:
        for frame in range(1, len(self.stage.cameras) + 1):
            self._film(frame)
        return self._clip_folder

    def frame(self, frame: int) -> NDArray[np.uint8]:
        bgr = cv2.imread(str(self._film(frame)))
        assert bgr is not None
        return np.ascontiguousarray(bgr[..., ::-1], dtype=np.uint8)

    def _film(self, frame: int) -> Path:
        path = self._clip_folder / f"frame_{frame:04d}.png"
        if not path.exists():
            with quiet(1):
                filming.film_frame(self.scene, frame, self._clip_folder, self._samples(frame))
        return path

    def _samples(self, frame: int) -> int:
        """Return the samples a pixel of a frame of the clip."""
        return FILM_SAMPLES

    @property
    def _clip_folder(self) -> Path:
        return store.FOLDER / self.folder / f"clip-{self.key}"

    def geometry(self, frame: int) -> truth.Geometry:
        def make() -> Floats:
            found = truth.geometry(self.scene, frame)
            return np.stack([found.depth, found.thing.astype(np.float64)])

        depth, thing = store.kept(self.folder, f"geometry-{frame:04d}", make)
        return truth.Geometry(depth, thing.astype(np.int32))

    def depth(self, frame: int) -> Floats:
        return self.geometry(frame).depth

    def moves(self, frame: int) -> NDArray[np.bool_]:
        """(H, W) what moves by itself."""
        moving_objects = [i for i, thing in enumerate(self.stage.things) if thing.moves]
        return np.isin(self.geometry(frame).thing, moving_objects)

    def subject(self, frame: int, name: str = "") -> NDArray[np.bool_] | None:
        """Of all subjects, or of the named one alone."""
        if not self.stage.subjects:
            return None
        wanted = (name,) if name else self.stage.subjects
        parts = [i for i, thing in enumerate(self.stage.things) if thing.subject in wanted]
        return np.isin(self.geometry(frame).thing, parts)

    def matte(self, frame: int) -> NDArray[np.float32] | None:
        """In frames that are not judged only depth is asked of it, and a true one takes many seconds."""
        subject = self.subject(frame)
        if subject is None or frame not in self.judged(self.blurs[0]):
            return None if subject is None else subject.astype(np.float32)

        def make() -> Picture:
            return truth.matte(self.scene, self.stage, frame, "", FILM_SAMPLES)

        return store.kept(self.folder, f"matte-{frame:04d}", make)

    def strokes(self, frame: int) -> dict[str, Floats]:
        masks = {name: self.subject(frame, name) for name in self.stage.subjects}
        return {name: stroke(mask, 5) for name, mask in masks.items() if mask is not None and mask.any()}

    def past_border(self, frame: int) -> NDArray[np.float32]:
        """From the frames that fusion has for it."""
        options, (here, _) = FusionOptions(), self.cameras.image_at(frame)
        camera = self.cameras.intrinsics(here)
        margin, span = int(BEYOND * camera.width), options.sides * options.step
        stack = []
        for image in self.cameras.images:
            apart = abs(image.frame - frame)
            if apart and apart <= span and apart % options.step == 0:
                inverse = (1 / self.depth(image.frame)).astype(np.float32)
                known = DenseDepth(
                    image.frame, inverse, np.ones_like(inverse), self.moves(image.frame), camera
                )
                stack.append(in_place(known, image, camera, here, margin))
        inside = (1 / self.depth(frame)).astype(np.float32)
        return past_border(stack, inside, level_of(inside))

    def focus_depth(self, frame: int, blur: int) -> float:
        return float(self.stage.focus_depth[frame - 1])

    def focus_xy(self, frame: int, blur: int) -> Floats:
        return np.asarray(self.stage.focus_xy[frame - 1], dtype=np.float64)

    def radius(self, blur: int) -> float:
        """The aperture whose largest disc over the judged frames is `blur` pixels."""
        focal = self.stage.cameras.focal
        contrast = [
            np.abs(1 / self.depth(frame) - 1 / self.focus_depth(frame, blur)).max()
            for frame in self.judged(blur)
        ]
        return float(blur / (2 * focal * max(contrast)))

    def margin(self, blur: int) -> int:
        return 0

    def truth(self, frame: int, blur: int) -> Truth:
        radius, focus = self.radius(blur), self.focus_depth(frame, blur)
        seeds = [
            store.kept(
                self.folder,
                f"lens-{frame:04d}-{blur}px-{self.noise:g}-seed{seed}",
                lambda seed=seed: truth.lens(self.scene, frame, radius, focus, self.noise, seed),  # type: ignore[misc]
            )
            for seed in (1, 2)
        ]
        return Truth((seeds[0] + seeds[1]) / 2, (seeds[0], seeds[1]))

    def motion(self, frame: int) -> Motion:
        return truth.motion(self.stage, frame, self.geometry(frame), self.geometry(frame + 1))

    def layers(self, frame: int, margin: int) -> oracle.LayeredDepthImage:
        numbers = sorted({thing.layer for thing in self.stage.things})
        made = [self._layer(frame, margin, number) for number in numbers]
        red, green, blue = self.stage.air
        return oracle.LayeredDepthImage(tuple(made), margin, (red, green, blue))

    def _layer(self, frame: int, margin: int, number: int) -> oracle.Layer:
        def make() -> NDArray[np.float32]:
            picture, depth = truth.layer(self.scene, self.stage, frame, number, margin, FILM_SAMPLES)
            return np.concatenate([clipped(picture), oracle.extended(depth)[..., None]], axis=-1)

        code = store.digest(store.sources("benchmarks/accuracy/scenes.py", "benchmarks/accuracy/oracle.py"))
        stored = store.kept(f"{self.folder}/layers-{code}", f"{frame:04d}-{number}-{margin}", make)
        return oracle.Layer(stored[..., :4], np.ascontiguousarray(stored[..., 4]))


class Resized(Staged):
    """A scene in pictures of another width."""

    def __init__(self, name: str, noise: float, width: int) -> None:
        super().__init__(name, noise)
        self.width = width

    @cached_property
    def stage(self) -> Stage:
        made = filming.load(self.name)
        cameras = made.cameras
        height = self.width * cameras.height // cameras.width
        return replace(made, cameras=cameras.resized(self.width, height))

    @remembered(4)
    def geometry(self, frame: int) -> truth.Geometry:
        """Depth is given: reading it is no method's cost."""
        return super().geometry(frame)

    @remembered(1)
    def past_border(self, frame: int) -> NDArray[np.float32]:
        return super().past_border(frame)

    def _samples(self, frame: int) -> int:
        """Fewer in frames that only lend colours: the product shrinks those, which averages their samples."""
        if frame in self.judged(0):
            return FILM_SAMPLES
        return max(1, round(FILM_SAMPLES * min(1, LONGEST_SIDE / self.width) ** 2))


class Short(Staged):
    """A scene as `make bench` judges it: small pictures, and only the frames around the judged ones."""

    def __init__(self, name: str, noise: float = NOISE) -> None:
        super().__init__(name, noise)
        self.blurs = tuple(round(share * SIZE[0]) for share in BLURS)

    @cached_property
    def stage(self) -> Stage:
        made = filming.load(self.name)
        first = max(len(made.cameras) // 2 - FRAMES // 2, 0)
        made = made.cut(slice(first, first + FRAMES))
        return replace(made, cameras=made.cameras.resized(*SIZE))

    @property
    def is_filmed(self) -> bool:
        """Whether the whole clip is there."""
        return (self._clip_folder / f"frame_{len(self.stage.cameras):04d}.png").exists()

    def judged(self, blur: int) -> tuple[int, ...]:
        """Two: the least that flicker is seen in."""
        middle = len(self.stage.cameras) // 2
        return (middle, middle + 1)


def clipped(picture: Picture) -> Picture:
    """A premultiplied picture (h, w, 4) with its colours as a camera records them: clipped, 8 bits.

    A camera clips what arrives at a pixel, so a light source that covers a third of one may still fill it.
    """
    steps = np.rint(255 * encode_srgb(np.clip(picture[..., :3], 0, 1))) / 255
    return np.concatenate([decode_srgb(steps), picture[..., 3:]], axis=-1).astype(np.float32)
