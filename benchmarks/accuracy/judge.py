"""One row of the benchmark: a method on a scene, scored against the truth."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import cv2
import numpy as np

from addon.core.base.errors import UserError
from addon.core.media.light import encode_srgb

from .. import store
from ..cost import Cost, measured
from . import metrics
from .cases import FromVideo, GroundTruth
from .cases import track as track_of
from .mask_metrics import outline_band
from .methods import METHODS, Answer
from .rows import Row
from .scenes import Picture, Scene, Truth

JUDGES = [
    f"benchmarks/accuracy/{name}.py"
    for name in ("judge", "metrics", "mask_metrics", "cases", "methods", "scenes")
]
# Read when the code is: a run of hours must not sign its rows with what was edited meanwhile.
CODE = {
    (name, track): store.digest(
        store.sources(*JUDGES, *method.sources, *(("addon/core",) if track != "T1" else ()))
    )
    for name, method in METHODS.items()
    for track in method.tracks
}


class Judge:
    """Scores methods on one scene at one blur; the truth is loaded, or rendered, once."""

    def __init__(self, scene: Scene, blur: int, count: int | None = None) -> None:
        """`count` judges only so many of the frames that there is truth for, the first ones."""
        self.scene, self.blur = scene, blur
        self.frames = scene.judged(blur)[:count]
        self._truths: list[Truth] = []

    @property
    def truths(self) -> list[Truth]:
        if not self._truths:
            self._truths = [self.scene.truth(frame, self.blur) for frame in self.frames]
        return self._truths

    def inputs(self, track_name: str, name: str) -> str:
        """Hashes of the scene and of the code that a row depends on."""
        scene = store.digest(self.scene.key, self.blur, self.frames, track_name)
        return f"{scene}-{CODE[name, track_name]}"

    def row(self, track_name: str, given: GroundTruth | FromVideo, name: str, views: int) -> Row:
        """Run the method on every judged frame and score it. A refusal becomes a row with a note."""
        method = METHODS[name]
        answers: list[Answer] = []
        costs: list[Cost] = []
        for frame in self.frames:
            try:
                answer, cost = measured(
                    partial(method.run, method.prepare(given.case(frame, self.blur)), views)
                )
            except UserError as problem:
                return self.refused(track_name, name, views, str(problem))
            answers.append(answer)
            costs.append(cost)
        save_picture(self.scene.name, track_name, self.blur, name, views, answers[len(answers) // 2].picture)
        return self._scored(track_name, name, views, answers, costs)

    def _scored(
        self, track_name: str, name: str, views: int, answers: list[Answer], costs: list[Cost]
    ) -> Row:
        pictures = [self._cropped(answer.picture) for answer in answers]
        truths = [self._cropped(truth.picture) for truth in self.truths]
        seeds = [(self._cropped(one), self._cropped(other)) for one, other in (t.seeds for t in self.truths)]
        warped = self._warped(pictures, truths)

        subjects = [self.scene.subject(frame) for frame in self.frames]
        bands = [self._cropped(outline_band(mask)) for mask in subjects if mask is not None]

        def score(masks: list[metrics.Mask]) -> float | None:
            scores = map(metrics.unbiased_psnr, pictures, seeds, [self._cropped(mask) for mask in masks])
            return _mean(list(scores))

        return Row(
            self.scene.name, track_name, name, views, self.blur, len(self.frames),
            self.inputs(track_name, name), self._ceiling,
            psnr=_mean(list(map(metrics.unbiased_psnr, pictures, seeds))),
            edge_psnr=score([metrics.edge_band(1 / self.scene.depth(frame)) for frame in self.frames]),
            in_focus_psnr=score([metrics.in_focus(self._disc(frame)) for frame in self.frames]),
            unclipped_psnr=score(
                [metrics.unclipped(self.scene.frame(frame), self._disc(frame)) for frame in self.frames]
            ),
            ssim=_mean(list(map(metrics.ssim, pictures, truths))),
            flip=_mean(list(map(metrics.flip, pictures, truths))),
            rm=_mean([metrics.rm(pictures, truths)]), rm_floor=self._rm_floor,
            warped=warped,
            subject_psnr=_mean(list(map(metrics.unbiased_psnr, pictures, seeds, bands))),
            subject_rm=_mean([metrics.rm(pictures, truths, bands)]) if bands else None,
            triangles=round(np.mean([a.triangles for a in answers])),
            cpu_s=_mean([c.cpu_s for c in costs]), wall_s=_mean([c.wall_s for c in costs]),
            peak_mb=_mean([max(c.peak_mb for c in costs)]),
        )  # fmt: skip

    @property
    def _ceiling(self) -> float:
        seeds = [[self._cropped(seed) for seed in truth.seeds] for truth in self.truths]
        return float(np.mean([metrics.noise_ceiling(one, other) for one, other in seeds]))

    @property
    def _rm_floor(self) -> float | None:
        """The mean of two seeds flickers half as much as their difference."""
        one, other = ([self._cropped(truth.seeds[n]) for truth in self.truths] for n in (0, 1))
        return _mean([metrics.rm(one, other) / 2])

    def _cropped[A: (Picture, metrics.Mask)](self, array: A) -> A:
        """Without the border that there is no truth for."""
        margin = self.scene.margin(self.blur)
        height, width = array.shape[:2]
        return np.ascontiguousarray(array[margin : height - margin, margin : width - margin])

    def _disc(self, frame: int) -> metrics.Floats:
        image, _ = self.scene.cameras.image_at(frame)
        focal = self.scene.cameras.intrinsics(image).fx
        contrast = 1 / self.scene.depth(frame) - 1 / self.scene.focus_depth(frame, self.blur)
        return np.asarray(2 * self.scene.radius(self.blur) * focal * contrast)

    def _warped(self, pictures: list[Picture], truths: list[Picture]) -> float | None:
        motions = [self.scene.motion(frame) for frame in self.frames[:-1]]
        known = [motion for motion in motions if motion is not None]
        if len(known) < len(motions) or not known:
            return None
        where, valid = zip(*known, strict=True)
        # Known for staged scenes only, which have truth up to the border.
        return _mean([metrics.warped_error(pictures, truths, where, valid)])

    def refused(self, track_name: str, name: str, views: int, why: str) -> Row:
        """A row without scores."""
        return Row(
            self.scene.name, track_name, name, views, self.blur, len(self.frames),
            self.inputs(track_name, name), self._ceiling, note=why,
        )  # fmt: skip


def given_by(track_name: str, scene: Scene) -> GroundTruth | FromVideo | str:
    """The track, or why the scene cannot be solved."""
    try:
        return track_of(track_name, scene)
    except UserError as problem:
        return str(problem)


def save_picture(scene: str, track_name: str, blur: int, method: str, views: int, picture: Picture) -> None:
    """For looking at: sRGB, 8 bits."""
    folder = store.FOLDER / "pictures"
    folder.mkdir(parents=True, exist_ok=True)
    name = f"{scene}-{track_name}-{blur}px-{method.replace(' ', '_')}-{views}.png"
    encoded = np.rint(255 * encode_srgb(np.clip(picture, 0, 1))).astype(np.uint8)
    cv2.imwrite(str(folder / name), encoded[..., ::-1])


def _mean(values: Sequence[float]) -> float | None:
    """None where there is nothing to average, which JSON can tell and NaN it cannot; 999 dB for equal."""
    found = np.array([v for v in values if not np.isnan(v)])
    return float(np.minimum(found, 999.0).mean()) if len(found) else None
