"""The shot that a scene holds: its reconstruction and its footage, read once and kept while it lasts."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path

import bpy
import numpy as np

from ...core.base.arrays import Floats, Map
from ...core.base.digest import code_digest
from ...core.base.errors import UserError
from ...core.base.lru_cache import remembered
from ...core.base.store import NOT_KEPT, Store
from ...core.camera.reconstruction import Reconstruction
from ...core.depth.user_depth import UserDepth
from ...core.depth.user_maps import open_depth
from ...core.frame.clip_context import ClipContext
from ...core.frame.quality import Quality
from ...core.media.clip import Footage, open_footage
from ...core.media.clip_identity import clip_digest, identity
from ...core.media.colour_space import ColourSpace
from ...core.media.fixed_area import FixedArea, fixed_area
from ...core.media.light import finite
from ...core.media.masks import Masks, open_masks
from ...core.media.picture_file import Pixels
from ...core.sfm.state import STATE
from ...core.sfm.workspace import check_size
from ...core.subjects.clip_subjects import ClipSubjects
from ...core.subjects.networks import Networks
from ...core.subjects.strokes import MarkedSubject
from ..base import version
from ..base.paths import absolute
from ..base.timeline import check_frames, clip_frame
from ..gpu import gpu_matcher
from ..solve import point_cloud
from . import subjects
from .clip import solved_clip_path, solved_part, work_dir
from .colour_space import REC_709, from_rec_709, space_of, working_space
from .masks import DrawnMask, drawn_mask

KEPT_DEPTH = "depth"
"""Folder of a working folder where depth is kept."""
IDENTITY = "virtual_aperture_identity"
REMEMBERED = 256 << 20
"""Bytes of pictures as they were read."""


@dataclass(frozen=True)
class Filmed:
    """A clip's pictures, and the user's masks of moving pixels."""

    footage: Footage
    masks: Masks | None = None
    drawn: DrawnMask | None = None
    space: ColourSpace | None = None
    """Colour space of the pictures if it is not sRGB."""
    repaired: dict[int, int] = field(default_factory=dict, compare=False)
    """Number of pixels that were not finite, by frame read so far."""

    @remembered(REMEMBERED, lambda picture: picture.nbytes)
    def read(self, frame: int) -> Pixels:
        """Return a frame's picture, remembered: depth, subjects and hidden colours need the same ones."""
        picture, count = finite(self.footage.read(frame))
        if count:
            self.repaired[frame] = count
        return picture if self.space is None else self.space.to_light(picture)

    def masked(self, frame: int) -> Map | None:
        """Return the opacity (H, W) of moving pixels by the user's masks over a frame; None without one."""
        given = [source.at(frame) for source in (self.masks, self.drawn) if source is not None]
        known = [mask for mask in given if mask is not None]
        return np.maximum.reduce(known) if known else None


@dataclass(frozen=True)
class Shot:
    """A clip and its solve."""

    footage: Footage
    reconstruction: Reconstruction
    depth: UserDepth | None = None
    """The user's depth maps."""
    masks: Masks | None = None
    """The user's pictures of moving pixels."""
    drawn: DrawnMask | None = None
    """The mask that is drawn in Blender; either is enough."""
    subjects: tuple[MarkedSubject, ...] = ()
    """Subjects that the user has marked by strokes."""
    space: ColourSpace | None = None
    """The clip's colour space, where it is not sRGB."""
    working: str = REC_709
    """The space of linear light that Blender works in."""
    from_rec_709: Floats | None = field(default=None, repr=False, compare=False)
    """As of `ClipContext`."""
    work: Path | None = None
    """The folder that keeps the solve, if there is one: depth is kept there, too."""
    keeps_fixed: bool = True
    """True to leave out what is burnt into the clip, and to keep it as it is."""
    segmenter: Path | None = None
    """The user's own segmenter."""

    filmed: Filmed | None = field(default=None, repr=False, compare=False)
    found: ClipSubjects | None = field(default=None, repr=False, compare=False)
    """Subjects found by another shot of the same clip and masks: strokes do not change them."""

    @cached_property
    def context(self) -> ClipContext:
        """The clip as the core's stages see it."""
        return ClipContext(
            self.reconstruction, self.clip.read, None, self._masks, self._store,
            self.subjects, self._found, self._kept(self._highlight_key), gpu_matcher.winning_levels,
            self.depth, self.from_rec_709, lambda: self.fixed,
        )  # fmt: skip

    @cached_property
    def fixed(self) -> FixedArea | None:
        """Overlays burnt into the clip; UserError where a frame cannot be read."""
        if not self.keeps_fixed or self.footage.is_stills:
            return None
        frames = [int(frame) for frame in self.reconstruction.frames]
        return fixed_area(self.footage.read, frames, self._kept(self._highlight_key))

    def with_subjects(self, marked: tuple[MarkedSubject, ...]) -> Shot:
        """Return the shot with others marked."""
        return replace(self, subjects=marked, filmed=self.clip, found=self._found)

    @cached_property
    def clip(self) -> Filmed:
        """The clip's pictures, the same for all shots that `with_subjects` returns."""
        return self.filmed or Filmed(self.footage, self.masks, self.drawn, self.space)

    @cached_property
    def _found(self) -> ClipSubjects:
        # Kept whatever strokes there are.
        kept = self._kept(lambda: self._key(self.network_digests))
        return self.found or ClipSubjects(
            self.reconstruction, lambda frame: self.context.scene(frame), kept, self.networks,
            fixed=lambda: None if self.fixed is None else self.fixed.covered,
        )  # fmt: skip

    @property
    def _masks(self) -> Callable[[int], Map | None] | None:
        return self.clip.masked if self.masks or self.drawn else None

    def size(self, frame: int) -> tuple[int, int]:
        """Return (width, height) in pixels of a frame's picture; UserError for a photo without a camera."""
        if not self.footage.is_stills:
            return self.footage.width, self.footage.height
        camera = self.context.canvas(frame).camera
        return camera.width, camera.height

    def frame_at(self, frame: int) -> int:
        """Return the clip's frame for a scene frame: in a gap, and past the ends, the nearest one before."""
        frames = np.array(self.footage.frames)
        return int(frames[max(0, int(np.searchsorted(frames, frame, side="right")) - 1)])

    def _store(self, quality: Quality) -> Store:
        return self._kept(partial(self._depth_key, quality))

    def _kept(self, key: Callable[[], str]) -> Store:
        """The storage under a key; nothing is kept without a working folder."""
        return Store(self.work / KEPT_DEPTH, key) if self.work else NOT_KEPT

    def _depth_key(self, quality: Quality) -> str:
        """16 hexadecimal digits of all inputs of the clip's depth in a quality, as its files are now."""
        marked = tuple(each.key for each in self.subjects)
        return self._key(marked, quality.stereo_side, quality.fusion, self.network_digests)

    def _highlight_key(self) -> str:
        """The same of highlights, whatever moves."""
        return _digest("highlights", code_digest("core"), self.clip_digests)

    def _key(self, *options: object) -> str:
        return _digest(code_digest("core"), self.clip_digests, self.mask_digests, options)

    @cached_property
    def networks(self) -> Networks:
        """The networks that cut out subjects."""
        return Networks(segmenter=self.segmenter)

    @property
    def network_digests(self) -> tuple[bool, str]:
        """Whether there are networks, and the digest of the user's own one."""
        return self.networks.exist, "" if self.segmenter is None else clip_digest(self.segmenter)

    @property
    def mask_digests(self) -> tuple[str, str]:
        """Digests of the user's masks; "" for one that there is not."""
        pictures = clip_digest(self.masks.pictures.path) if self.masks else ""
        return pictures, self.drawn.digest if self.drawn else ""

    @property
    def clip_digests(self) -> tuple[str, ...]:
        """Digests of the clip and its solve, and how its pictures are read."""
        # As the solve knows its clip: known already, where all bytes of a sequence would have to be read.
        # Pictures of sRGB are compared as they are stored.
        space = () if self.space is None else (self.space.name,)
        if self.space is not None and self.working != REC_709:
            space = *space, self.working
        whole = () if self.keeps_fixed else ("whole",)
        return identity(self.footage.path), self._reconstruction_digest, *space, *whole

    @cached_property
    def _reconstruction_digest(self) -> str:
        return reconstruction_digest(self.reconstruction)


def _digest(*things: object) -> str:
    return hashlib.sha256(repr(things).encode()).hexdigest()[:16]


def reconstruction_digest(reconstruction: Reconstruction) -> str:
    """Return 64 hexadecimal digits of cameras and points."""
    digest = hashlib.sha256()
    digest.update(repr(reconstruction.cameras).encode())
    if not reconstruction.is_ordered:
        digest.update(b"stills")
    if any(reconstruction.readout):
        digest.update(repr(reconstruction.readout).encode())
    for image in reconstruction.images:
        digest.update(f"{image.frame} {image.camera}".encode())
        for array in (image.rotation, image.translation, image.xy, image.points):
            digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(np.ascontiguousarray(reconstruction.points.xyz).tobytes())
    return digest.hexdigest()


_shots: dict[tuple[str, ...], Shot] = {}
"""One shot is kept, by its parts: every frame of an animation asks for the same one."""
_read: dict[str, Reconstruction] = {}
"""The last reconstruction that was read, by its identity: every edit of the lens asks for it."""


def shot_of(scene: bpy.types.Scene, within: float = 0.0) -> Shot:
    """Return the scene's shot; UserError naming what is missing. `within` as of `trouble_with`."""
    settings = scene.virtual_aperture
    mesh = points_mesh(settings)
    path = solved_clip_path(settings, within)
    depth_path, masks_path, segmenter = (
        str(absolute(p, scene)) if p else ""
        for p in (settings.depth_maps, settings.masks, settings.segmenter)
    )
    drawn = settings.mask
    marked = subjects.marked_of(settings)
    key = (
        str(mesh.get(IDENTITY)), str(path), depth_path, masks_path, segmenter,
        drawn.name_full if drawn else "", settings.colour_space, working_space(),
        str(settings.clip_pixel_aspect), str(settings.fixed),
    )  # fmt: skip
    shot = _shots.get(key)
    if shot is None or (shot.drawn and drawn and not shot.drawn.is_still(drawn, clip_frame(scene))):
        reconstruction = reconstruction_of(settings)
        footage = _opened(settings, path)
        check_frames(footage)
        solved = solved_part(settings, footage) if depth_path or masks_path else footage
        depth = UserDepth.of(open_depth(Path(depth_path), solved), reconstruction) if depth_path else None
        masks = open_masks(Path(masks_path), solved) if masks_path else None
        size = (footage.width, footage.height)
        shapes = drawn_mask(drawn, footage.frames, size) if drawn else None
        work = work_dir(settings, path)
        kept = work if (work / STATE).exists() else None
        space = space_of(settings, footage)
        light = space, working_space(), from_rec_709()
        own = Path(segmenter) if segmenter else None
        shot = Shot(
            footage, reconstruction, depth, masks, shapes, marked, *light, kept, settings.fixed, own
        )  # fmt: skip
    elif shot.subjects != marked:
        shot = shot.with_subjects(marked)
    _shots.clear()
    _shots[key] = shot
    return shot


def solved_clip(settings: bpy.types.PropertyGroup) -> Footage:
    """Open the clip of a scene's solve; UserError where it is not found, or is another one."""
    return _opened(settings, solved_clip_path(settings))


def _opened(settings: bpy.types.PropertyGroup, path: Path) -> Footage:
    reconstruction = reconstruction_of(settings)
    clip = open_footage(path, stills=not reconstruction.is_ordered, pixel_aspect=settings.clip_pixel_aspect)
    check_size(clip, reconstruction)
    return clip


def reconstruction_of(settings: bpy.types.PropertyGroup) -> Reconstruction:
    """Return the reconstruction alone, for which the footage need not be there."""
    mesh = points_mesh(settings)
    identity = mesh.get(IDENTITY)
    if identity is None:
        return point_cloud.read(mesh)
    of_shots = {key[0]: shot.reconstruction for key, shot in _shots.items()}
    if identity in of_shots:
        return of_shots[identity]
    if identity not in _read:
        _read.clear()
        _read[identity] = point_cloud.read(mesh)
    return _read[identity]


def picture_size(scene: bpy.types.Scene) -> tuple[int, int]:
    """Return (width, height) in pixels of the clip's picture in the scene's frame.

    The footage need not exist.

    Raises:
        UserError: The scene has no solve, or the photo no camera.
    """
    solved = reconstruction_of(scene.virtual_aperture)
    if solved.is_ordered:
        camera = solved.cameras[solved.images[0].camera]
    else:
        camera = solved.intrinsics(solved.image_at(clip_frame(scene))[0])
    return camera.width, camera.height


def points_mesh(settings: bpy.types.PropertyGroup) -> bpy.types.Mesh:
    """Return the mesh of the point cloud; UserError where the scene has none, or a newer version made it."""
    version.check(settings)
    if settings.points is None or settings.points.type != "MESH":
        raise UserError("the scene has no solved clip; choose a clip and solve it first")
    # The evaluated mesh has lost these attributes in the modifier that hides the points.
    return settings.points.original.data


def forget() -> None:
    """Drop the kept shot and its open video file."""
    _shots.clear()
    _read.clear()
