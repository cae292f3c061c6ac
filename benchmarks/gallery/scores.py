"""A clip's row of the table: how its steps ended, and the figures of its pictures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.media.colour_space import ColourSpace
from addon.core.media.light import encode_srgb

from .. import store
from ..accuracy.mask_metrics import iou
from . import matte, metrics
from .clips import RealClip
from .commands import Ended
from .metrics import Detail, Noise, Pixels
from .stages import Steps

MEASURING = "clips", "matte", "metrics", "row_outlines", "scores"
"""Modules of this package that figures depend on."""
DEEPEST = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}
"""Value of white by the kind of a picture."""


@dataclass(frozen=True)
class Row:
    """What is known of a clip."""

    clip: RealClip
    solve: Ended | None
    clicked: Ended | None
    default: Ended | None
    row: Ended | None
    detail: Detail | None = None
    """Of the middle frame with a click."""
    by_default: float | None = None
    """Share of its detail that the subject keeps with nothing picked."""
    row_keeps: tuple[float, float] | None = None
    """Share of its detail that the subject keeps in the frames of the row: mean and least."""
    noise: Noise | None = None
    flicker: float | None = None
    overlap: float | None = None
    """Mean IoU of the program's matte and the true mask, over the frames that have both; 0 for a frame whose
    matte is empty. None where the data has no masks."""

    @property
    def failure(self) -> str:
        """The message of the first step that failed; empty where none did, or none was run."""
        for name, ended in (("", self.solve), ("click: ", self.clicked), ("default: ", self.default),
                            ("row: ", self.row)):  # fmt: skip
            if ended is not None and ended.status:
                return name + ended.message
        return ""

    @property
    def is_rendered(self) -> bool:
        """Whether there is a picture with a click."""
        return self.clicked is not None and not self.clicked.status


def taken(steps: Steps, with_row: bool, run: bool = True) -> Row:
    """Take a clip's steps, or only read those that are kept, and measure its pictures."""
    clip = steps.clip
    solve = steps.solve(run)
    if solve is None or solve.status:
        return Row(clip, solve, None, None, None)
    clicked = steps.clicked(run)
    if clicked is None:
        return Row(clip, solve, None, None, None)
    default = steps.default(run)
    row = steps.row(run and with_row) if clip.has_row and not clicked.status else None
    ended = Row(clip, solve, clicked, default, row)
    return replace(ended, **_figures(steps, ended))


def _figures(steps: Steps, ended: Row) -> dict[str, Any]:
    """The figures of a row, as they are kept beside the pictures, or measured and kept."""
    own = [Path(__file__).with_name(f"{name}.py") for name in MEASURING]
    ends = [file for kind in ("click", "default", "row") if (file := steps.folder / f"{kind}.json").exists()]
    key, kept = store.digest(own, ends), steps.folder / "figures.json"
    held = json.loads(kept.read_text()) if kept.exists() else {}
    if held.get("key") != key:
        held = {"key": key, **_measured(steps, ended)}
        kept.write_text(json.dumps(held, indent=1))
    del held["key"]
    for name, kind in (("detail", Detail), ("noise", Noise)):
        if name in held:
            held[name] = kind(**held[name])
    return held


def _measured(steps: Steps, ended: Row) -> dict[str, Any]:
    """The figures of a row for JSON, of the steps that were not refused."""
    clip, frames, found = steps.clip, steps.clip.near_middle, dict[str, Any]()
    sources = [shown(clip, frame) for frame in frames]
    subjects = [clip.subject(frame) for frame in frames]
    if ended.default is not None and not ended.default.status:
        picture = read(steps.picture("default", clip.middle))
        found["by_default"] = metrics.detail(sources[0], picture, subjects[0]).subject
    if ended.is_rendered:
        results = [read(steps.picture("click", frame)) for frame in frames]
        found["detail"] = asdict(metrics.detail(sources[0], results[0], subjects[0]))
        found["noise"] = asdict(metrics.noise(sources[0], results[0], subjects[0]))
        found["flicker"] = metrics.flicker(sources, results, subjects)
        if overlaps := list(_overlaps(steps, ended.row)):
            found["overlap"] = float(np.mean(overlaps))
    if ended.row is not None and not ended.row.status:
        each = [
            metrics.detail(shown(clip, frame), read(steps.picture("row", frame)), clip.subject(frame)).subject
            for frame in clip.row
        ]
        found["row_keeps"] = float(np.mean(each)), min(each)
    return found


def _overlaps(steps: Steps, row: Ended | None) -> Iterator[float]:
    """IoU of every rendered frame that has a true mask."""
    frames = set(steps.clip.near_middle)
    if row is not None and not row.status:
        frames |= set(steps.clip.row)
    for frame in sorted(frames):
        truth = steps.clip.drawn_mask(frame)
        if truth is None:
            continue
        found = matte.used(steps.folder / "work", frame, truth.shape)
        yield 0.0 if found is None else iou(metrics.touching(found, truth), truth)


def read(path: Path) -> Pixels:
    """(H, W, 3) a picture's RGB; SystemExit where it cannot be read."""
    picture = cv2.imread(str(path))
    if picture is None:
        raise SystemExit(f"{path} is missing or cannot be read; remove its folder and run again")
    return np.asarray(picture[..., ::-1], np.uint8)


def shown(clip: RealClip, frame: int) -> Pixels:
    """(H, W, 3) a frame of the source as the program shows it where everything is sharp, display-encoded."""
    footage = clip.footage
    picture = footage.read(frame)[..., :3]
    if footage.colour_space not in ("", "sRGB"):
        picture = np.asarray(encode_srgb(np.clip(_to_light(footage.colour_space, picture), 0, 1)))
        return np.rint(255 * picture).astype(np.uint8)
    return np.rint(255 * (picture / DEEPEST[picture.dtype])).astype(np.uint8)


def _to_light(name: str, picture: NDArray[Any]) -> metrics.Map:
    return np.asarray(_space(name).to_light(picture), np.float32)


@cache
def _space(name: str) -> ColourSpace:
    # Blender takes seconds to load, and one clip needs it.
    from addon.scene.sources.colour_space import colour_space

    return colour_space(name)
