"""Pictures of the live preview, as the process that makes them draws them (`preview` asks for them)."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.base.arrays import Floats, LinearRGBA
from ...core.base.calls import show
from ...core.base.errors import UserError
from ...core.base.progress import stage
from ...core.frame.detail import resized
from ...core.frame.frame_path import READ, WARPED, mesh_frame
from ...core.frame.highlights import HighlightSettings
from ...core.frame.inspection import SOURCE_VIEWS
from ...core.frame.inspection import picture as inspected
from ...core.frame.meshers import MESHERS
from ...core.frame.plan import FrameOptions
from ...core.frame.quality import DRAFT, FAIR_LOOK, FINAL, FIRST_LOOK, NORMAL
from ...core.media.light import to_linear
from ...scene.sources.shot import Shot
from ..cg import cg_preview
from ..cg.cg_preview import CGWanted
from ..views.average import draw_shares, render_frame

Half = NDArray[np.float16]
Key = tuple[int, int, str, str]
COARSE_SIDE = 240
"""Pixels of the longer side of the first picture: a draft of the sample clip takes 0.14 s so small, and 0.43
at 640x360, on 2 cores in software OpenGL (`benchmarks.special interface` at 010ab4e6)."""
ROUGH_VIEWS = 16
"""Views of a picture from the feature points, 240 pixels wide. It takes 0.08 s. Chosen by looking at it."""
NO_HIGHLIGHTS = HighlightSettings(gain=0.0)
CLIP, ROUGH, FIRST, COARSE, FAIR, FINE = range(-1, 5)
"""How good a picture is: the frame as it was shot alone; small, from the feature points, and a first look
from the frame's own neighbours, while depth is being found; a small draft; a fair look; the scene's quality,
normal at most."""


@dataclass(frozen=True)
class Wanted:
    """The content of a viewport."""

    shot: Shot
    frame: int
    """Frame of the clip."""
    options: FrameOptions
    size: tuple[int, int]
    """Width and height in pixels, of the clip's shape."""
    shows: str = ""
    """The name of one of `inspection.NAMES` in place of the frame through the lens."""
    with_clip: bool = False
    """True if the frame as it was shot is beside it."""
    is_playing: bool = False
    """True if frames follow each other faster than they are drawn."""
    cg: CGWanted | None = None
    """The CG objects in it, if there are any."""

    @cached_property
    def key(self) -> Key:
        """Identifies the picture's content, without its size and the frame beside it."""
        return id(self.shot), self.frame, self.shows, repr((self.options, self.cg))

    def asks_for(self, other: Wanted) -> bool:
        """Return whether making this also makes another one."""
        same = self.key == other.key and self.is_playing == other.is_playing
        return same and self.with_clip >= other.with_clip and self.size[0] >= other.size[0]

    def looks_alike(self, other: Wanted) -> bool:
        """Return whether another one shows the same frame through the same lens, but for its depth.

        After a stroke over a subject or a repair, the last good picture stays until a better one is made.
        """
        same = repr(replace(self.options, repairs=())) == repr(replace(other.options, repairs=()))
        return (
            same and self.frame == other.frame and self.shows == other.shows and self.cg == other.cg
            and self.shot.reconstruction is other.shot.reconstruction
        )  # fmt: skip

    @property
    def best(self) -> int:
        """The best level that is worth its time."""
        return FAIR if self.shows or self.is_playing else FINE


@dataclass(frozen=True)
class Picture:
    """A frame as a viewport may show it."""

    wanted: Wanted
    level: int
    linear: Half
    """(h, w, 4) linear light, premultiplied."""
    clip: Half | None = None
    """(H, W, 4) the frame as it was shot, if it was asked for."""
    boxes: Sequence[Floats] = ()
    """Boxes of subjects and faces, as `ClipSubjects.boxes`; none before the best level."""

    @property
    def nbytes(self) -> int:
        """Bytes of its pixels."""
        return self.linear.nbytes + (self.clip.nbytes if self.clip is not None else 0)


@dataclass(frozen=True)
class Made:
    """A picture as it comes from the other process; see `Picture`."""

    level: int
    linear: Half
    clip: Half | None
    boxes: Sequence[Floats]
    seconds: float
    """How long it took."""


def make_next(wanted: Wanted, level: int, is_quick: bool, file: Path | None) -> Made:
    """Make a frame at a level, or at the next one that is worth its time; passes checkpoints.

    Shows the level, and whether depth must be found for it, before it begins.

    Args:
        wanted: The content.
        level: The level after the best that there is.
        is_quick: True if a draft is so quick that nothing coarser is needed before.
        file: The .blend with the CG objects.

    Raises:
        UserError: As of `render_frame`.
    """
    began = time.monotonic()
    is_known = has_depth(wanted)
    if ROUGH <= level <= FIRST and (is_known or (wanted.shows and level == FIRST)):
        level = COARSE
    if level == COARSE and (is_quick or wanted.shows):
        level = FAIR
    show((level, level > ROUGH and not is_known))
    picture = make_picture(wanted, level, file)
    return Made(picture.level, picture.linear, picture.clip, picture.boxes, time.monotonic() - began)


def make_picture(wanted: Wanted, level: int, file: Path | None = None) -> Picture:
    """Return a frame at a level, with CG objects of a .blend; errors and checkpoints as of `render_frame`."""
    if level == CLIP:
        clip = _clip(wanted)
        return Picture(wanted, level, clip, clip)
    if level == ROUGH:
        linear = _rough(wanted)
    else:
        linear = _inspected(wanted) if wanted.shows else _through_lens(wanted, level, file)
    beside = _clip(wanted) if wanted.with_clip else None
    boxes = wanted.shot.context.boxes(wanted.frame) if level == wanted.best and not wanted.is_playing else ()
    return Picture(wanted, level, linear.astype(np.float16), beside, boxes)


def _clip(wanted: Wanted) -> Half:
    """The frame as it was shot."""
    with stage("Reading", 0.0, 0.0):
        picture = wanted.shot.context.picture(wanted.frame, NO_HIGHLIGHTS)
        return np.asarray(cv2.resize(picture, wanted.size, interpolation=cv2.INTER_AREA), np.float16)


def _rough(wanted: Wanted) -> LinearRGBA:
    """A picture (h, w, 4) without depth; as it was shot if there are too few feature points.

    Before a camera that stays, only subjects have a distance, and to find them takes longer than a look.
    """
    context = wanted.shot.context
    is_flat = wanted.shot.reconstruction.stays and context.may_focus_on_subjects
    if not (wanted.shows or is_flat):
        with contextlib.suppress(UserError):
            return _through_lens(wanted, ROUGH)
    return _clip(wanted).astype(np.float32)


def _through_lens(wanted: Wanted, level: int, file: Path | None = None) -> LinearRGBA:
    context, options, size = wanted.shot.context, wanted.options, wanted.size
    if level <= FAIR:
        options = replace(options, quality=FIRST_LOOK if level == FIRST else FAIR_LOOK)
    if level == ROUGH:
        options = replace(options, method="features", views=ROUGH_VIEWS)
    if level <= COARSE or wanted.is_playing:
        options = replace(options, grain=0.0)
        # Colours of other frames, and their highlights, take seconds for the first time.
        options = replace(options, borrow=False)
        if not context.knows_highlights(wanted.frame, options.highlights):
            options = replace(options, highlights=NO_HIGHLIGHTS)
    if level in (ROUGH, COARSE):
        size = _coarse(size)
        options = replace(options, quality=replace(options.quality, longest=COARSE_SIDE // 2))
    elif options.quality == FINAL:
        options = replace(options, quality=NORMAL)
    # Until Cycles has drawn them, the clip is seen without.
    waits = level == wanted.best and not wanted.is_playing
    draw_cg = cg_preview.draw_preview(wanted.cg, file if waits else None)
    return render_frame(context, wanted.frame, options, size, lambda note: None, None, draw_cg)


def _inspected(wanted: Wanted) -> LinearRGBA:
    """(h, w, 4) what a frame is drawn from, of `Wanted.shows`."""
    context, size = wanted.shot.context, wanted.size
    options = replace(wanted.options, quality=NORMAL, highlights=NO_HIGHLIGHTS)
    with stage("Reading", 0.0, READ):
        source = resized(context.picture(wanted.frame, options.highlights), size)
    with stage("Mesh", READ, WARPED):
        frame = mesh_frame(context, wanted.frame, options, size, source).through(SOURCE_VIEWS)
    shares = draw_shares(frame) if wanted.shows == "sources" else None
    shown = inspected(wanted.shows, frame, shares)
    return source if shown is None else to_linear(shown)


def _coarse(size: tuple[int, int]) -> tuple[int, int]:
    smaller = -(-max(size) // COARSE_SIDE)
    return -(-size[0] // smaller), -(-size[1] // smaller)


def has_depth(wanted: Wanted) -> bool:
    """Return whether a frame's depth is known."""
    context = wanted.shot.context
    return not MESHERS[wanted.options.method].needs_pixel_depth or context.has_depth(wanted.frame, DRAFT)
