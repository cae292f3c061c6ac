"""The live preview: what is made, in which order, and what ends it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.base import calls
from addon.core.base.errors import UserError
from addon.core.base.progress import Cancelled, checkpoint, reporting
from addon.core.base.worker import Call
from addon.core.camera.reconstruction import Intrinsics
from addon.core.focus.focus import Focus
from addon.core.frame.plan import FrameOptions
from addon.core.frame.quality import FINAL
from addon.core.frame.repairs import Repair
from addon.core.subjects.strokes import MarkedSubject
from addon.render.processes.clip_process import ClipProcess
from addon.render.viewport import pictures, preview, viewport
from addon.render.viewport.pictures import (
    CLIP,
    COARSE,
    FAIR,
    FINE,
    FIRST,
    ROUGH,
    Picture,
    Wanted,
    make_picture,
)
from addon.render.viewport.preview import Preview
from addon.render.views.average import render_frame
from addon.scene.build import build
from addon.scene.sources.shot import shot_of

from ..scenes import slanted_shot
from ..waiting import until

Previews = Callable[[Callable[[Wanted, int], Picture]], Preview]
PLAIN = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)


@pytest.fixture
def wanted(scene: bpy.types.Scene, tmp_path: Path) -> Wanted:
    shot = slanted_shot(tmp_path, PLAIN)
    build(scene, shot.footage, shot.reconstruction)
    lens = FrameOptions(Focus(distance=8.0), radius=0.4, method="features")
    return Wanted(shot_of(scene), 2, lens, (PLAIN.width, PLAIN.height))


class Meanwhile(ClipProcess):
    """Calls functions in threads of this process, whose pictures `make` makes."""

    def call[T](self, function: Callable[[], T]) -> Call[T]:
        call = Call[T](0, lambda _: None)
        cancelled = threading.Event()
        call.cancel = cancelled.set  # type: ignore[method-assign]

        def on_progress(stage: str, share: float) -> None:
            if cancelled.is_set():
                raise Cancelled

        def run() -> None:
            calls._show = call.shown.append
            try:
                with reporting(on_progress):
                    call._value.append(function())
            except Exception as error:
                call.error = error
            call.ended = True

        threading.Thread(target=run, daemon=True).start()
        return call

    def poll(self) -> None:
        """Nothing comes from elsewhere."""


@pytest.fixture
def previews(monkeypatch: pytest.MonkeyPatch) -> Iterator[Previews]:
    """Makes previews whose pictures a function makes."""
    made: list[Preview] = []

    def begin(make: Callable[[Wanted, int], Picture]) -> Preview:
        monkeypatch.setattr(pictures, "make_picture", lambda wanted, level, file: make(wanted, level))
        made.append(Preview(Meanwhile()))
        return made[-1]

    yield begin
    calls._show = None
    for each in made:
        each.forget()


def test_a_good_picture_stays_until_the_depth_is_mended(wanted: Wanted) -> None:
    stroke = Repair("nearer", 2, ((0.5, 0.5),))
    mended = replace(wanted, options=replace(wanted.options, repairs=(stroke,)))
    marked = replace(wanted, shot=wanted.shot.with_subjects((MarkedSubject("cat", ()),)))
    assert mended.key != wanted.key and marked.key != wanted.key
    assert mended.looks_alike(wanted) and marked.looks_alike(wanted)
    for change in ({"frame": 3}, {"options": replace(wanted.options, radius=0.2)}, {"shows": "blur"}):
        assert not replace(wanted, **change).looks_alike(wanted)
    good, rough = (Picture(mended, level, np.zeros((1, 1, 4), np.float16)) for level in (FINE, COARSE))
    viewport.PREVIEW.forget()
    assert viewport._picture(wanted, good) is good and viewport._picture(wanted, rough) is rough
    viewport.PREVIEW._keep(replace(rough, wanted=wanted))
    assert viewport._picture(wanted, good) is good
    viewport.PREVIEW._keep(replace(good, wanted=wanted))
    found = viewport._picture(wanted, good)
    assert found is not None and found is viewport.PREVIEW.best(wanted) and found.level == FINE
    viewport.PREVIEW.forget()


def eventually(shown: Preview, condition: Callable[[], bool]) -> None:
    def is_so() -> bool:
        shown.poll()
        return condition()

    until(is_so, every=0.005)


class Maker:
    """Makes grey pictures when it is allowed to, with checkpoints while it waits."""

    def __init__(self) -> None:
        self.made: list[tuple[int, int]] = []
        self.begun: list[tuple[int, int]] = []
        self.may = threading.Event()
        self.may.set()

    def __call__(self, wanted: Wanted, level: int) -> Picture:
        self.begun.append((wanted.frame, level))
        while not self.may.wait(0.001):
            checkpoint()
        checkpoint()
        self.made.append((wanted.frame, level))
        return Picture(wanted, level, np.full((90, 160, 4), level, np.float16))


def test_better_pictures_follow(previews: Previews, wanted: Wanted) -> None:
    maker = Maker()
    shown = previews(maker)
    shown.want(wanted)
    eventually(shown, lambda: not shown.is_busy())
    assert maker.made == [(2, COARSE), (2, FAIR), (2, FINE)]
    best = shown.best(wanted)
    assert best is not None and best.level == FINE
    shown.want(replace(wanted, frame=3, is_playing=True))
    eventually(shown, lambda: not shown.is_busy())
    # Of a film that is played no frame is worth more than a draft.
    assert maker.made[-1] == (3, FAIR)
    shown.want(wanted)
    eventually(shown, lambda: not shown.is_busy())
    assert maker.made[-1] == (3, FAIR), "the frame before was kept"


def test_the_feature_points_are_enough_to_begin_with(previews: Previews, wanted: Wanted) -> None:
    maker = Maker()
    shown = previews(maker)
    layers = replace(wanted, options=replace(wanted.options, method="layers"))
    shown.want(layers)
    eventually(shown, lambda: not shown.is_busy())
    assert maker.made == [(2, ROUGH), (2, FIRST), (2, COARSE), (2, FAIR), (2, FINE)]
    rough, fine = make_picture(layers, ROUGH), make_picture(wanted, FINE)
    means = [picture.linear.astype(float).mean(axis=(0, 1)) for picture in (rough, fine)]
    assert np.allclose(*means, atol=0.01)
    assert (
        np.diff(rough.linear.astype(float), axis=1).std()
        < 0.8
        * np.diff(make_picture(replace(layers, shows="depth"), ROUGH).linear.astype(float), axis=1).std()
    )


def test_the_last_wish_counts(previews: Previews, wanted: Wanted) -> None:
    maker = Maker()
    shown = previews(maker)
    shown._draft_seconds = 2 * preview.QUICK
    maker.may.clear()
    shown.want(replace(wanted, frame=1))
    eventually(shown, lambda: (1, COARSE) in maker.begun)
    shown.want(replace(wanted, frame=3))
    maker.may.set()
    eventually(shown, lambda: not shown.is_busy())
    assert maker.made[-1] == (3, FINE)
    # What is soon made is seen, what takes long is not made.
    assert (1, COARSE) in maker.made
    assert (1, FAIR) not in maker.begun and (1, FINE) not in maker.begun


def test_a_quick_draft_is_seen_although_another_frame_is_wanted(previews: Previews, wanted: Wanted) -> None:
    maker = Maker()
    shown = previews(maker)
    shown.want(wanted)
    eventually(shown, lambda: not shown.is_busy())
    maker.may.clear()
    late, last = replace(wanted, frame=1), replace(wanted, frame=3)
    shown.want(late)
    eventually(shown, lambda: (1, FAIR) in maker.begun)
    shown.want(last)
    shown.poll()
    assert shown.best(last) is None
    maker.may.set()
    eventually(shown, lambda: (1, FAIR) in maker.made)
    eventually(shown, lambda: not shown.is_busy())
    assert (1, FINE) not in maker.begun, "time for a frame that nobody looks at"
    best = shown.latest(last)
    assert best is not None and (best.wanted.frame, best.level) == (3, FINE)
    assert shown.latest(replace(last, shows="depth")) is None, "a picture of something else"


def test_pausing_ends_what_is_under_way(previews: Previews, wanted: Wanted) -> None:
    maker = Maker()
    shown = previews(maker)
    maker.may.clear()
    shown.want(wanted)
    eventually(shown, lambda: bool(maker.begun))
    with shown.paused():
        maker.may.set()
        eventually(shown, lambda: shown._call is None)
        assert maker.made == [] and shown.best(wanted) is None and not shown.is_busy()
    eventually(shown, lambda: not shown.is_busy())
    assert maker.made[-1] == (2, FINE)


def test_problems_are_told_and_not_tried_again(previews: Previews, wanted: Wanted) -> None:
    made = []

    def fail(_wanted: Wanted, level: int) -> Picture:
        made.append(level)
        raise UserError("the clip is gone; choose it again")

    shown = previews(fail)
    shown.want(wanted)
    eventually(shown, lambda: bool(shown.problem(wanted)))
    assert shown.problem(wanted) == "the clip is gone; choose it again"
    shown.want(wanted)
    eventually(shown, lambda: not shown.is_busy())
    assert len(made) == 1
    shown.forget()
    assert shown.problem(wanted) == ""


def test_pictures_are_forgotten_at_a_limit(
    previews: Previews, wanted: Wanted, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(preview, "KEPT", 3 * 90 * 160 * 4 * 2)
    shown = previews(Maker())
    for frame in range(1, 6):
        shown.want(replace(wanted, frame=frame))
        eventually(shown, lambda: not shown.is_busy())
    kept = [frame for frame in range(1, 6) if shown.best(replace(wanted, frame=frame)) is not None]
    assert kept == [3, 4, 5]


def test_the_best_picture_is_what_is_rendered(wanted: Wanted) -> None:
    assert wanted.best == FINE
    fine = make_picture(wanted, FINE)
    rendered = render_frame(wanted.shot.context, 2, wanted.options, wanted.size, lambda note: None)
    assert np.array_equal(fine.linear, rendered.astype(np.float16))
    # Final's depth is not searched for a look.
    final = replace(wanted, options=replace(wanted.options, quality=FINAL))
    assert np.array_equal(make_picture(final, FINE).linear, fine.linear)
    assert replace(wanted, is_playing=True).best == FAIR


def test_the_clip_is_added_to_a_picture_that_is_there(previews: Previews, wanted: Wanted) -> None:
    maker, as_shot = Maker(), np.full((90, 160, 4), 7, np.float16)
    shown = previews(lambda w, level: replace(maker(w, level), clip=as_shot if w.with_clip else None))
    shown.want(wanted)
    eventually(shown, lambda: not shown.is_busy())
    plain = shown.best(wanted)
    assert plain is not None and plain.clip is None
    del maker.made[:]
    both = replace(wanted, with_clip=True)
    shown.want(both)
    eventually(shown, lambda: not shown.is_busy())
    assert maker.made == [(2, CLIP)], "nothing is drawn anew"
    best = shown.best(both)
    assert best is not None and best.level == FINE
    assert best.clip is as_shot and best.linear is plain.linear
    shown.want(wanted)
    assert not shown.is_busy(), "it is there, too, when it is looked at without the clip"


def test_a_clip_without_a_focus_is_shown_as_it_was_shot(wanted: Wanted) -> None:
    nothing = replace(wanted, options=replace(wanted.options, focus=Focus()))
    rough = make_picture(nothing, ROUGH)
    assert rough.linear.shape[:2] == (90, 160)
    with pytest.raises(UserError):
        make_picture(nothing, FAIR)
