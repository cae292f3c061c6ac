"""The blurred frame for a viewport: coarse at once, then better.

Another process makes it (`render.processes.clip_process`), one picture at a time, the last one requested.
"""

from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

from ...core.base.calls import Failed
from ...core.base.errors import UserError
from ...core.base.progress import Cancelled
from ...core.base.streams import say_to
from ...core.base.worker import Call, Ended
from ...scene.base.remedy_words import WORDS
from ..cg import cg_preview
from ..processes.clip_process import CLIP as CLIP_PROCESS
from ..processes.clip_process import ClipProcess
from .pictures import CLIP, COARSE, FAIR, Key, Made, Picture, Wanted, make_next

KEPT = 256 << 20
"""Bytes of pictures that are kept for going back to: 140 frames of 640x360."""
QUICK = 0.25
"""Seconds that a draft may take for nothing coarser to be shown before it: four frames a second."""


class Preview:
    """Has pictures made, from coarse to final, and keeps them."""

    def __init__(self, process: ClipProcess = CLIP_PROCESS) -> None:
        """Have pictures made by a process."""
        self._process = process
        self._wanted: Wanted | None = None
        self._pauses = 0
        self._step: tuple[Wanted, int] | None = None
        """The content that is being made, and its level,"""
        self._call: Call[Made] | None = None
        """by this call."""
        self._kept: OrderedDict[Key, Picture] = OrderedDict()
        self._latest: Picture | None = None
        self._problems: dict[Key, str] = {}
        self._draft_seconds = 2 * QUICK
        self._restarted: Key | None = None
        """The content that was being made when the process ended last."""
        self.finds_depth = False
        """True if the present work needs depth that is not kept."""
        self.version = 0
        """Counted up whenever there is something new to show."""
        self.note = ""
        """A line about the process, for the viewport, until there is a better picture."""

    @property
    def progress(self) -> tuple[str, float]:
        """Name of the stage of the present work, and its done share, 0 to 1."""
        return ("", 0.0) if self._call is None else (self._call.stage, self._call.share)

    def want(self, wanted: Wanted) -> None:
        """Have this made from now on, in place of the present work; `poll` begins it."""
        now = self._wanted
        if now is None or not now.asks_for(wanted):
            self._wanted = wanted

    def best(self, wanted: Wanted) -> Picture | None:
        """Return the best picture of the wanted content; None without one."""
        found = self._kept.get(wanted.key)
        if found is not None:
            self._kept.move_to_end(wanted.key)
        return found

    def latest(self, wanted: Wanted) -> Picture | None:
        """Return the last picture if it shows the same kind of content of the same clip.

        It is of another frame, or lens, and is seen until there is one of the wanted content.
        """
        made = self._latest
        if made is None or made.wanted.shot is not wanted.shot or made.wanted.shows != wanted.shows:
            return None
        return made

    def problem(self, wanted: Wanted) -> str:
        """Return the reason why there is no picture, or ""."""
        return self._problems.get(wanted.key, "")

    def is_busy(self) -> bool:
        """Return whether a better picture is in progress."""
        return self._step is not None or self._next() is not None

    @property
    def waits(self) -> bool:
        """Return whether it goes on after a pause."""
        return self._pauses > 0 and self._wanted is not None

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Suspend all work while others take the processors. The present work is cancelled."""
        self._pauses += 1
        self._cancel()
        try:
            yield
        finally:
            self._pauses -= 1

    def retry(self) -> None:
        """Try failed pictures again."""
        self._problems.clear()
        self.note = ""

    def forget(self) -> None:
        """End what is under way, and drop all pictures."""
        self._cancel()
        self._call = self._step = self._wanted = self._latest = None
        self._kept.clear()
        self.retry()

    def poll(self) -> None:
        """Read answers, and have the next picture made."""
        if self._step is not None and self._call is not None:
            self._process.poll()
            self._follow(*self._step, self._call)
        if self._step is None and (step := self._next()) is not None:
            self._begin(*step)

    def _cancel(self) -> None:
        if (call := self._call) is not None:
            call.cancel()

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
            self.version += bool(self.note)
            self._restarted, self.note = None, ""
            return None
        return wanted, done + 1

    def _begin(self, wanted: Wanted, level: int) -> None:
        self.finds_depth = False
        try:
            # Cycles draws them of the file as it is now.
            waits = wanted.best in (level, FAIR)
            file = cg_preview.file_of(wanted.cg) if wanted.cg is not None and waits else None
            made = partial(make_next, wanted, level, self._draft_seconds < QUICK, file)
            self._step, self._call = (wanted, level), self._process.call(made)
        except UserError as error:
            self._fail(wanted, error.worded(WORDS))

    def _follow(self, wanted: Wanted, level: int, call: Call[Made]) -> None:
        """Keep the picture of a call, or cancel it if nobody would look at the picture."""
        if call.shown:
            level, self.finds_depth = call.shown[-1]
        now = self._wanted
        is_wanted = now is not None and now.key == wanted.key
        if not call.ended:
            # A coarse picture or a quick draft, and whatever a film that is played has time for, is shown
            # although it is late: else nothing would be seen while focus or the current frame is dragged.
            is_quick = level <= (FAIR if self._draft_seconds < QUICK else COARSE)
            is_soon = is_quick or (now is not None and now.is_playing)
            is_late = now is not None and is_soon and not self.finds_depth
            if self._pauses or not (is_wanted or is_late):
                call.cancel()
            return
        self._call = self._step = None
        self.finds_depth = False
        try:
            made = call.result()
        except Cancelled:
            return
        except Ended as error:
            if self._restarted == wanted.key:
                self._fail(wanted, f"The preview failed: {error}")
                return
            self._restarted, self.note = wanted.key, f"The preview is begun again: {error}"
            self.version += 1
            say_to(2, f"note: {self.note}")
        except UserError as error:
            self._fail(wanted, error.worded(WORDS))
        except Failed as error:
            text, trace = error.args
            say_to(2, trace)
            self._fail(wanted, f"The preview failed: {text} (see the console)")
        else:
            if made.level == FAIR and not wanted.shows:
                self._draft_seconds = made.seconds
            self._keep(Picture(wanted, made.level, made.linear, made.clip, made.boxes))

    def _keep(self, picture: Picture) -> None:
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
        self._problems[wanted.key] = text
        self.version += 1
