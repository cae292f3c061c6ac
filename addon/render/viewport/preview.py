"""The blurred frame for a viewport: made on a thread, coarse at once, then better.

The thread computes; its views are drawn by the main thread in slices (`scene.main_thread`), so that the
interface stays alive. One picture is made at a time, the last one requested.
"""

from __future__ import annotations

import contextlib
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.base import memory
from ...core.base.arrays import LinearRGBA
from ...core.base.errors import UserError
from ...core.base.progress import Cancelled, reporting, stage
from ...core.frame.detail import resized
from ...core.frame.frame_path import READ, WARPED, Drawn, mesh_frame
from ...core.frame.highlights import HighlightSettings
from ...core.frame.inspection import SOURCE_VIEWS
from ...core.frame.inspection import picture as inspected
from ...core.frame.meshers import MESHERS
from ...core.frame.plan import FrameOptions
from ...core.frame.quality import DRAFT, FINAL, FIRST_LOOK, NORMAL
from ...core.media.light import to_linear
from ...scene.base.remedy_words import WORDS
from ...scene.sources.shot import Shot
from ..cg import cg_preview
from ..cg.cg_preview import CGWanted
from ..views.average import draw_shares, render_frame

Half = NDArray[np.float16]
Key = tuple[int, int, str, str]

KEPT = 256 << 20
"""Bytes of pictures that are kept for going back to: 140 frames of 640x360."""
COARSE_SIDE = 240
"""Pixels of the longer side of the first picture: a draft of the sample clip takes 0.14 s so small, and 0.43
at 640x360, on 2 cores in software OpenGL (`python -m benchmarks.timings.interface`)."""
QUICK = 0.25
"""Seconds that a draft may take for nothing coarser to be shown before it: four frames a second."""
ROUGH_VIEWS = 16
"""Views of a picture from the feature points, 240 pixels wide. It takes 0.08 s. Chosen by looking at it."""
NO_HIGHLIGHTS = HighlightSettings(gain=0.0)
CLIP, ROUGH, FIRST, COARSE, FAIR, FINE = range(-1, 5)
"""How good a picture is: the frame as it was shot alone; small, from the feature points, and a first look
from the frame's own neighbours, while depth is being found; a small draft; a draft at the preview's size; the
same in the scene's quality, normal at most."""


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
        if self.shows:
            return FAIR
        return FAIR if self.is_playing or self.options.quality == DRAFT else FINE


@dataclass(frozen=True)
class Picture:
    """A frame as a viewport may show it."""

    wanted: Wanted
    level: int
    linear: Half
    """(h, w, 4) linear light, premultiplied."""
    clip: Half | None = None
    """(H, W, 4) the frame as it was shot, if it was asked for."""

    @property
    def nbytes(self) -> int:
        """Bytes of its pixels."""
        return self.linear.nbytes + (self.clip.nbytes if self.clip is not None else 0)


class Preview:
    """Makes pictures, from coarse to final, and keeps them."""

    def __init__(self, make: Callable[[Wanted, int], Picture] | None = None) -> None:
        """`make` makes a picture at a level, as `make_picture`, on the thread."""
        self._make_picture = make or make_picture
        self._changed = threading.Condition()
        self._wanted: Wanted | None = None
        self._pauses = 0
        self._is_working = False
        self._thread: threading.Thread | None = None
        self._kept: OrderedDict[Key, Picture] = OrderedDict()
        self._latest: Picture | None = None
        self._problems: dict[Key, str] = {}
        self._draft_seconds = 2 * QUICK
        self._level = ROUGH
        self.finds_depth = False
        """True if the present work needs depth that is not kept."""
        self.version = 0
        """Counted up whenever there is something new to show."""
        self.progress = ("", 0.0)
        """Name of the stage of the present work, and its done share, 0 to 1."""

    # Asked for on the main thread

    def want(self, wanted: Wanted) -> None:
        """Make this from now on, in place of the present work."""
        with self._changed:
            now = self._wanted
            if now is not None and now.asks_for(wanted):
                return
            self._wanted = wanted
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._run, name="preview", daemon=True)
                self._thread.start()
            self._changed.notify_all()

    def best(self, wanted: Wanted) -> Picture | None:
        """Return the best picture of the wanted content; None without one."""
        with self._changed:
            found = self._kept.get(wanted.key)
            if found is not None:
                self._kept.move_to_end(wanted.key)
            return found

    def latest(self, wanted: Wanted) -> Picture | None:
        """Return the last picture if it shows the same kind of content of the same clip.

        It is of another frame, or lens, and is seen until there is one of the wanted content.
        """
        with self._changed:
            made = self._latest
            if made is None or made.wanted.shot is not wanted.shot or made.wanted.shows != wanted.shows:
                return None
            return made

    def problem(self, wanted: Wanted) -> str:
        """Return the reason why there is no picture, or ""."""
        return self._problems.get(wanted.key, "")

    def is_busy(self) -> bool:
        """Return whether a better picture is in progress."""
        with self._changed:
            return self._is_working or self._next() is not None

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Suspend all work while others work with the clip.

        Waits for the end of the present work, which is cancelled.
        """
        with self._changed:
            self._pauses += 1
        try:
            while self._is_working:
                time.sleep(0.005)
            yield
        finally:
            with self._changed:
                self._pauses -= 1
                self._changed.notify_all()

    def forget(self) -> None:
        """End what is under way, and drop all pictures."""
        with self._changed:
            self._wanted = self._latest = None
            self._kept.clear()
            self._problems.clear()
            self._changed.notify_all()
        with self.paused():
            pass

    def close(self) -> None:
        """Call `forget`, and end the thread; a later request begins another."""
        self.forget()
        thread = self._thread
        with self._changed:
            self._thread = None
            self._changed.notify_all()
        if thread is not None:
            thread.join()

    # The thread

    def _run(self) -> None:
        while True:
            with self._changed:
                while (step := self._next()) is None:
                    if self._thread is not threading.current_thread():
                        return
                    self._changed.wait()
                self._is_working = True
            try:
                self._make(*step)
            finally:
                with self._changed:
                    self._is_working = False
                    self.progress = ("", 0.0)

    def _next(self) -> tuple[Wanted, int] | None:
        """The next content and its level; None if all is done."""
        wanted = self._wanted
        if wanted is None or self._pauses or wanted.key in self._problems:
            return None
        kept = self._kept.get(wanted.key)
        done = -1 if kept is None else kept.level
        if kept is not None and kept.linear.shape[1] < wanted.size[0] and done > COARSE:
            done = COARSE
        if kept is not None and kept.clip is None and wanted.with_clip:
            return wanted, CLIP
        if done >= wanted.best:
            return None
        return wanted, done + 1

    def _make(self, wanted: Wanted, level: int) -> None:
        began = time.monotonic()
        try:
            is_known = has_depth(wanted)
            if ROUGH <= level <= FIRST and (is_known or (wanted.shows and level == FIRST)):
                level = COARSE
            if level == COARSE and (self._draft_seconds < QUICK or wanted.shows):
                level = FAIR
            self._level, self.finds_depth = level, level > ROUGH and not is_known
            with reporting(lambda name, share: self._on_progress(wanted, name, share)):
                picture = self._make_picture(wanted, level)
        except Cancelled:
            return
        except UserError as error:
            self._fail(wanted, error.worded(WORDS))
        except Exception as error:
            if memory.is_shortage(error):
                self._fail(wanted, str(memory.shortage("the preview could not be drawn")))
                return
            traceback.print_exc()
            self._fail(wanted, f"The preview failed: {type(error).__name__}: {error} (see the console)")
        else:
            if level == FAIR and not wanted.shows:
                self._draft_seconds = time.monotonic() - began
            self._keep(picture)

    def _on_progress(self, wanted: Wanted, name: str, share: float) -> None:
        self.progress = (name, share)
        now = self._wanted
        is_wanted = now is not None and now.key == wanted.key
        # A coarse picture or a quick draft, and whatever a film that is played has time for, is shown
        # although it is late: else nothing would be seen while focus or the current frame is dragged.
        is_quick = self._level <= (FAIR if self._draft_seconds < QUICK else COARSE)
        is_soon = is_quick or (now is not None and now.is_playing)
        is_late = now is not None and is_soon and not self.finds_depth
        if self._pauses or not (is_wanted or is_late):
            raise Cancelled

    def _keep(self, picture: Picture) -> None:
        with self._changed:
            before = self._kept.get(picture.wanted.key)
            if before is not None and picture.level == CLIP:
                picture = replace(before, clip=picture.clip)
            elif before is not None and picture.clip is None:
                picture = replace(picture, clip=before.clip)
            self._kept[picture.wanted.key] = self._latest = picture
            self._kept.move_to_end(picture.wanted.key)
            while len(self._kept) > 1 and sum(p.nbytes for p in self._kept.values()) > KEPT:
                self._kept.popitem(last=False)
            self.version += 1

    def _fail(self, wanted: Wanted, text: str) -> None:
        with self._changed:
            self._problems[wanted.key] = text
            self.version += 1


def make_picture(wanted: Wanted, level: int) -> Picture:
    """Return a frame at a level; UserError as `render_frame`. Passes checkpoints."""
    if level == CLIP:
        clip = _clip(wanted)
        return Picture(wanted, level, clip, clip)
    if level == ROUGH:
        linear = _rough(wanted)
    else:
        linear = _inspected(wanted) if wanted.shows else _through_lens(wanted, level)
    return Picture(wanted, level, linear.astype(np.float16), _clip(wanted) if wanted.with_clip else None)


def _clip(wanted: Wanted) -> Half:
    """The frame as it was shot."""
    with stage("Reading", 0.0, 0.0):
        picture = wanted.shot.context.picture(wanted.frame, NO_HIGHLIGHTS)
        return np.asarray(cv2.resize(picture, wanted.size, interpolation=cv2.INTER_AREA), np.float16)


def _rough(wanted: Wanted) -> LinearRGBA:
    """A picture (h, w, 4) without depth; as it was shot if there are too few feature points."""
    if not wanted.shows:
        with contextlib.suppress(UserError):
            return _through_lens(wanted, ROUGH)
    return _clip(wanted).astype(np.float32)


def _through_lens(wanted: Wanted, level: int) -> LinearRGBA:
    context, options, size = wanted.shot.context, wanted.options, wanted.size
    if level <= FAIR:
        quality = FIRST_LOOK if level == FIRST else DRAFT
        options = replace(options, quality=quality)
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
    elif options.quality == FINAL:
        options = replace(options, quality=NORMAL)
    # Until Cycles has drawn them, the clip is seen without.
    waits = level == wanted.best and not wanted.is_playing
    draw_cg = cg_preview.draw_preview(wanted.cg, waits)
    return render_frame(context, wanted.frame, options, size, lambda note: None, None, draw_cg)


def _inspected(wanted: Wanted) -> LinearRGBA:
    """(h, w, 4) what a frame is drawn from, of `Wanted.shows`."""
    context, size = wanted.shot.context, wanted.size
    options = replace(wanted.options, quality=NORMAL, highlights=NO_HIGHLIGHTS)
    with stage("Reading", 0.0, READ):
        source = resized(context.picture(wanted.frame, options.highlights), size)
    with stage("Mesh", READ, WARPED):
        warped = mesh_frame(context, wanted.frame, options, size, source).through(SOURCE_VIEWS)
    shares = draw_shares(Drawn(warped, source, 0.0)) if wanted.shows == "sources" else None
    shown = inspected(wanted.shows, warped, source, shares)
    return source if shown is None else to_linear(shown)


def _coarse(size: tuple[int, int]) -> tuple[int, int]:
    smaller = -(-max(size) // COARSE_SIDE)
    return -(-size[0] // smaller), -(-size[1] // smaller)


def has_depth(wanted: Wanted) -> bool:
    """Return whether a frame's depth is known."""
    context = wanted.shot.context
    return not MESHERS[wanted.options.method].needs_pixel_depth or context.has_depth(wanted.frame, DRAFT)
