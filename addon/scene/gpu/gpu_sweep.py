"""The plane sweep and the semiglobal sums on a GPU: costs stay there, and only the winners come back.

As `core.depth.matching.winning_levels` on the processor, which is the reference. The costs of a picture of
960x540 pixels and 64 levels take 66 MB, and four to five times as much lies on the GPU at once. Pictures are
at most 960 pixels long (`multi_view_stereo.LONG_SIDE`), so no more than twice that is ever taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import cv2
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...core.base.arrays import Bytes, Floats, Map
from ...core.depth.matching import PRIOR_COST, PRIOR_REACH, RIVAL_MARGIN, Winners
from ...core.depth.plane_sweep import FAR_PREFERENCE, GUIDE_EPSILON, GUIDE_RADIUS, TRUNCATION, View
from ...core.depth.semiglobal import P1, P2, P2_HALVED_AT, STEPS
from . import gpu_sweep_shaders as shaders
from .main_thread import Steps, draw, leave_shader

UNKNOWN = -1e6
"""Level of a pixel without features."""

type Texture = gpu.types.GPUTexture


def winning_levels(picture: Bytes, views: Sequence[View], levels: Floats, guide: Map, known: Map) -> Winners:
    """Find depth levels on the GPU; see `matching.winning_levels`.

    Passes checkpoints; needs a GPU context.

    Raises:
        RuntimeError, SystemError: The GPU cannot run the shaders.
    """
    sweep = _Sweep(picture, sorted(views, key=lambda view: view.side), levels, guide, known)
    return draw(sweep.steps(), sweep.count)


@dataclass(frozen=True)
class _Sweep:
    """The arguments of `winning_levels`, the views of one side before those of the other, and the steps."""

    picture: Bytes
    views: Sequence[View]
    levels: Floats
    guide: Map
    known: Map

    @property
    def quads(self) -> int:
        """Layers of four levels each."""
        return -(-len(self.levels) // 4)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the picture."""
        return self.guide.shape[1], self.guide.shape[0]

    @property
    def count(self) -> int:
        """Steps: as many as there are, and as many more as others do of a frame's depth after them."""
        return round((self.quads + 4) / 0.7)

    def steps(self) -> Steps[Winners]:
        """Return each ends by waiting for the GPU, so that none comes to a watchdog with the work of many.

        Between two of them another window's GPU context may become the active one: textures and shaders are
        shared by all of them, and framebuffers are made where they are used.
        """
        given = {
            "frame": _texture(self.picture, "RGBA8"),
            "guide": _texture(self._guide(), "RGBA32F"),
            "planes": _texture(self._planes(), "RGBA32F"),
        }
        guide = given["guide"]
        first, second, costs = (_room(self.size, "RGBA16UI", self.quads) for _ in range(3))
        yield from self._swept(given, first)
        spreads = _room(self.size, "R32F")
        self._stage("finish", {**given, "raw": first}, {"costs": costs, "spreads": spreads}).over(
            self.size, levels=len(self.levels), unknown=UNKNOWN, prior=STEPS * PRIOR_COST,
            reach=PRIOR_REACH,
        )  # fmt: skip
        _wait()
        # The sweep's result is in `costs`: its texture is reused for sums.
        for way in self._summed(guide, costs, first, second):
            yield self.quads + way
        return self._won(costs, second, spreads)

    def _swept(self, given: Mapping[str, Texture], into: Texture) -> Iterator[int]:
        """Write mismatches (`plane_sweep.sweep` less its last part), four levels a step."""
        sides = sorted({view.side for view in self.views})
        split = sum(view.side == sides[0] for view in self.views)
        pictures = _texture(_stacked([view.picture for view in self.views]), "RGBA8")
        means = _room(self.size, "RGBA32F", 2)
        lines = _room(self.size, "RGBA32F", 6)
        given = {**given, "pictures": pictures, "means": means, "lines": lines}
        mismatch = self._stage("mismatch", given, {"means": means})
        slopes = self._stage("slopes", given, {"lines": lines})
        gather = self._stage("gather", given, {"costs": into})
        for quad in range(self.quads):
            mismatch.over(
                self.size, quad=quad, levels=len(self.levels), sides=len(sides), split=split,
                views=len(self.views), truncation=TRUNCATION, steps=STEPS,
            )  # fmt: skip
            slopes.over(self.size, sides=len(sides), radius=GUIDE_RADIUS)
            gather.over(self.size, quad=quad, sides=len(sides), radius=GUIDE_RADIUS)
            _wait()
            yield quad

    def _stage(self, name: str, reads: Mapping[str, Texture], writes: Mapping[str, Texture]) -> _Stage:
        return _Stage(name, shaders.compute(name, self.quads), reads, writes)

    def _summed(self, guide: Texture, costs: Texture, first: Texture, second: Texture) -> Iterator[int]:
        """Write costs summed along four ways into `second`; `first` is written to."""
        width, height = self.size
        shader = shaders.compute("paths", self.quads)
        for way in range(4):
            before, after = (second, first) if way % 2 == 0 else (first, second)
            read = {"guide": guide, "costs": costs, "before_sums": before}
            across = way // 2
            _Stage("paths", shader, read, {"sums": after}).over(
                (height if across else width, 1), across=across, backwards=way % 2, adds=int(way > 0),
                p1=STEPS * P1, p2=STEPS * P2, halved_at=P2_HALVED_AT,
            )  # fmt: skip
            _wait()
            yield way

    def _won(self, costs: Texture, sums: Texture, spreads: Texture) -> Winners:
        """The winners of costs and their sums."""
        shader = shaders.winners()
        target = _room(self.size, "RGBA32F")
        screen = batch_for_shader(shader, "TRIS", {"xy": shaders.SCREEN})
        frame_buffer = gpu.types.GPUFrameBuffer(color_slots=(target,))
        with frame_buffer.bind():
            gpu.state.depth_test_set("NONE")
            gpu.state.blend_set("NONE")
            shader.bind()
            shader.uniform_int("levels", len(self.levels))
            shader.uniform_int("margin", round(STEPS * RIVAL_MARGIN))
            for name, texture in (("costs", costs), ("sums", sums), ("spreads", spreads)):
                shader.uniform_sampler(name, texture)
            screen.draw(shader)
        leave_shader()
        buffer = target.read()
        buffer.dimensions = 4 * self.guide.size
        found = np.frombuffer(buffer, np.float32).reshape(*self.guide.shape, 4)
        level, rivals, cost, spread = (found[..., n].copy() for n in range(4))
        # Each level is its own rival.
        if not np.isfinite(found).all() or rivals.min() < 1:
            raise RuntimeError("it gave an empty or broken picture")
        return Winners(level, rivals.astype(np.intp), cost / np.float32(STEPS), spread / np.float32(STEPS))

    def _guide(self) -> Map:
        """(h, w, 4) grey level, local mean, one over local variance plus epsilon, and the known level."""
        guide = self.guide.astype(np.float64)
        window = (2 * GUIDE_RADIUS + 1,) * 2
        mean, square = (
            cv2.boxFilter(part, -1, window, borderType=cv2.BORDER_REFLECT) for part in (guide, guide**2)
        )
        weight = 1 / (square - mean**2 + GUIDE_EPSILON)
        return np.dstack([guide, mean, weight, np.nan_to_num(self.known, nan=2 * UNKNOWN)]).astype(np.float32)

    def _planes(self) -> Map:
        """(k, 3 n, 4) homographies of n views by level, with whether a view sees the plane, and the cost."""
        width, height = self.size
        planes = np.zeros((len(self.levels), len(self.views), 3, 4), np.float32)
        for n, view in enumerate(self.views):
            for k, inverse in enumerate(self.levels.tolist()):
                planes[k, n, :, :3] = view.homography(inverse)
                planes[k, n, 0, 3] = view.sees_plane(inverse, width, height)
        planes[:, 0, 1, 3] = np.rint(np.linspace(0, STEPS * FAR_PREFERENCE, len(self.levels)))
        return planes.reshape(len(self.levels), -1, 4)


class _Stage:
    """A compute shader with its inputs and outputs."""

    def __init__(
        self,
        name: str,
        shader: gpu.types.GPUShader,
        reads: Mapping[str, Texture],
        writes: Mapping[str, Texture],
    ) -> None:
        """Textures that the shader does not name are left out."""
        self._program, self._shader, self._writes = shaders.PROGRAMS[name], shader, writes
        self._reads = {name: reads[name] for name, _ in self._program.reads}

    def over(self, size: tuple[int, int], **values: float) -> None:
        """Run it for every pixel of a picture (width, height), with its numbers and values by name."""
        self._shader.bind()
        for name, value in values.items():
            if name in self._program.numbers:
                self._shader.uniform_int(name, int(value))
            else:
                self._shader.uniform_float(name, value)
        for name, texture in self._reads.items():
            self._shader.uniform_sampler(name, texture)
        for name, texture in self._writes.items():
            self._shader.image(name, texture)
        across, down = (-(-side // by) for side, by in zip(size, self._program.group, strict=True))
        gpu.compute.dispatch(self._shader, across, down, 1)


def _stacked(pictures: Sequence[Bytes]) -> Bytes:
    """(n, H, W, 4) pictures (h, w, 4), with nothing past the border of smaller ones."""
    height, width = (max(picture.shape[axis] for picture in pictures) for axis in (0, 1))
    stacked = np.zeros((len(pictures), height, width, 4), np.uint8)
    for picture, into in zip(pictures, stacked, strict=True):
        into[: picture.shape[0], : picture.shape[1]] = picture
    return stacked


def _texture(values: Map | Bytes, texels: str) -> Texture:
    """A texture of values (h, w, 4), or with layers of (n, h, w, 4); bytes become shares of 255."""
    data = np.array(values, np.float32).reshape(-1)
    if values.dtype == np.uint8:
        data /= 255
    layers = len(values) if values.ndim == 4 else 0
    buffer = gpu.types.Buffer("FLOAT", data.size, data)
    return gpu.types.GPUTexture(values.shape[-2:-4:-1], layers=layers, format=texels, data=buffer)


def _room(size: tuple[int, int], texels: str, layers: int = 0) -> Texture:
    """A texture (width, height) that is to be written to."""
    return gpu.types.GPUTexture(size, layers=layers, format=texels)


def _wait() -> None:
    """End a step: wait for the GPU, by reading a pixel."""
    leave_shader()
    # The framebuffer does not keep it.
    pixel = _room((1, 1), "RGBA8")
    frame_buffer = gpu.types.GPUFrameBuffer(color_slots=(pixel,))
    with frame_buffer.bind():
        frame_buffer.clear(color=(0.0, 0.0, 0.0, 0.0))
        frame_buffer.read_color(0, 0, 1, 1, 4, 0, "UBYTE")
