"""Error over CPU seconds, with and without depth: `python -m benchmarks.special envelope`.

The first judged frame of a few scenes, at one blur, in pictures of one or more widths. T1 has its depth
given; in T2, at the sample scenes' own width alone, it is found, and a method that needs that of every pixel
pays what it takes in the mean over consecutive frames after the first. What all need, tracking and solving,
is not counted. The error is that of the pixels which no clipped highlight reaches: what a sensor clipped, no
method here brings back. The cost of what is cheap is the least of a few runs. Past 640 pixels the truth has
more noise, which the score leaves out; past 1920 pixels no method has more than 32 views, and Defocus is
left out.

Writes `envelope.json`, of which a run replaces its own panels, `envelope.md` and `envelope.png` of results.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import asdict, dataclass, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path

import numpy as np

from addon.core.base.errors import UserError
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.quality import NORMAL, QUALITIES
from addon.core.subjects.clip_subjects import ClipSubject, ClipSubjects
from sample_scenes.stage import WIDTH

from .. import store
from ..cost import Cost, measured
from . import metrics, report
from .cases import FromVideo, GroundTruth
from .judge import save_picture
from .methods import METHODS, Answer
from .rows import RESULTS, Row
from .scenes import Resized, Truth

NAME = "envelope"
"""Of the files of results."""
NOISE, MORE_NOISE = 0.02, 0.05
"""Of the truth, at the sample scenes' own width and past it."""
OURS = ("layers", "draft", "normal", "final", "features")
VIEWS = {
    "layers": (4, 8, 16, 32, 64, 256), "draft": (0,), "normal": (0,), "final": (0,), "features": (4, 16, 64),
    "thesis": (4, 16, 64, 256), "scatter": (0,), "Defocus": (0,), "Cycles, our mesh": (4, 16, 64),
}  # fmt: skip
"""Methods, and the numbers of views or samples that each is judged with."""
LARGE, MOST_VIEWS, SLOW = 1920, 32, "Defocus"
"""Width past which no method has more than so many views, and a method is left out: it would take minutes."""
WARMED = ("layers", "draft", "final")
"""The first ones of each quality."""
RUNS, CHEAP = 3, 2.0
"""Times that a point of at most so many CPU seconds is drawn: other work on the machine only adds."""
HEAD = "| method | views | PSNR | edges | in focus | unclipped | CPU s |"


@dataclass(frozen=True)
class Curve:
    """What was found of a scene on a track at a size."""

    scene: str
    track: str
    size: tuple[int, int]
    rows: tuple[Row, ...]
    """With what depth costs, where it is counted."""
    measured: str = ""
    """Commit, date and machine."""

    @property
    def title(self) -> str:
        """The panel's."""
        counted = "depth counted" if self.track == "T2" else "depth given"
        width, height = self.size
        return f"{self.scene}, {width}x{height}, {counted}, disc {self.rows[0].blur_px} px"

    @property
    def envelope(self) -> str:
        """Where another method is above ours: by how much, and at which cost."""
        ours = sorted((r.cpu_s or 0.0, _error(r)) for r in self.rows if r.method in OURS)
        said = []
        for row in self.rows:
            if row.method in OURS or row.cpu_s is None:
                continue
            reached = max((error for cost, error in ours if cost <= row.cpu_s), default=None)
            name = f"{row.method} {row.views or ''}".strip()
            if reached is None:
                said.append(
                    f"{name}: {_error(row):.2f} dB for {row.cpu_s:.2f} s, less than any of ours takes"
                )
            elif reached < _error(row):
                said.append(f"{name}: {_error(row) - reached:.2f} dB above ours at {row.cpu_s:.2f} s")
        return "; ".join(said) or "ours is the upper one at every cost"


def _error(row: Row) -> float:
    value = row.psnr if row.unclipped_psnr is None else row.unclipped_psnr
    return float("nan") if value is None else value


@dataclass(frozen=True)
class NoSubjects(ClipSubjects):
    """No subject is found."""

    @property
    def people(self) -> list[ClipSubject]:  # type: ignore[override]
        return []

    @property
    def objects(self) -> list[ClipSubject]:  # type: ignore[override]
        return []


class Given(GroundTruth):
    """True cameras and depth; frames are filmed when they are first read, and read once."""

    @cached_property
    def whole(self) -> ClipContext:
        """The clip with its true cameras, no features and no search for subjects, which reads all frames."""
        read = lru_cache(16)(self.scene.frame)
        nobody = NoSubjects(self.scene.cameras, read)
        return ClipContext(self.scene.cameras, read, known_subjects=nobody)


class Scores:
    """Of methods' pictures of one frame of a scene."""

    def __init__(self, scene: Resized, frame: int, blur: int) -> None:
        self.scene, self.frame, self.blur = scene, frame, blur

    @cached_property
    def truth(self) -> Truth:
        """What a real lens makes of the frame."""
        return self.scene.truth(self.frame, self.blur)

    @cached_property
    def ceiling(self) -> float:
        """PSNR of one seed of the truth against the other."""
        return metrics.noise_ceiling(*self.truth.seeds)

    @cached_property
    def masks(self) -> dict[str, metrics.Mask]:
        """(H, W) the pixels of each score of a row."""
        scene, inverse = self.scene, 1 / self.scene.depth(self.frame)
        scale = 2 * scene.radius(self.blur) * scene.stage.cameras.focal
        disc = scale * (inverse - 1 / scene.focus_depth(self.frame, self.blur))
        return {
            "edges": metrics.edge_band(inverse),
            "in focus": metrics.in_focus(disc),
            "unclipped": metrics.unclipped(scene.frame(self.frame), disc),
        }

    def row(self, track: str, given: GroundTruth | FromVideo, name: str, views: int) -> Row:
        """Run a method, a few times where that is cheap, and score it; a refusal is a row with a note."""
        method = METHODS[name]
        row = Row(self.scene.name, track, name, views, self.blur, 1, self.scene.key, self.ceiling)
        try:
            runs: list[tuple[Answer, Cost]] = []
            while not runs or (len(runs) < RUNS and runs[0][1].cpu_s <= CHEAP):
                # A case of its own each: one remembers what it has found.
                case = method.prepare(given.case(self.frame, self.blur))
                runs.append(measured(partial(method.run, case, views)))
        except UserError as problem:
            return replace(row, note=str(problem))
        picture, cost = runs[0][0].picture, min((cost for _, cost in runs), key=lambda cost: cost.cpu_s)
        save_picture(f"{row.scene}-{self.scene.width}", track, self.blur, name, views, picture)
        error = metrics.unbiased_error(picture, self.truth.seeds)

        def score(pixels: str) -> float | None:
            found = metrics.psnr_of(error, self.masks[pixels])
            return None if np.isnan(found) else found

        return replace(
            row, psnr=metrics.psnr_of(error), edge_psnr=score("edges"), in_focus_psnr=score("in focus"),
            unclipped_psnr=score("unclipped"), cpu_s=cost.cpu_s, wall_s=cost.wall_s,
        )  # fmt: skip


def main() -> None:
    """Run, and write results, table and plot."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", nargs="+", default=["bars", "walk"])
    parser.add_argument("--blur", type=int, default=32, help="largest disc in px of a picture of 640")
    parser.add_argument("--tracks", nargs="+", default=["T1", "T2"], choices=["T1", "T2"])
    parser.add_argument("--widths", nargs="+", type=int, default=[WIDTH], metavar="PIXELS")
    options = parser.parse_args()
    for name in options.scenes:
        for width in options.widths:
            for track in options.tracks:
                if track == "T1" or width == WIDTH:
                    put(RESULTS, curve(name, track, width, options.blur))
    print((RESULTS / f"{NAME}.md").read_text())


def curve(name: str, track: str, width: int, blur: int) -> Curve:
    """Every method on a scene's first judged frame; `blur` is the largest disc in a picture of 640 pixels."""
    scene = Resized(name, NOISE if width <= WIDTH else MORE_NOISE, width)
    blur = blur * width // WIDTH
    scores = Scores(scene, scene.judged(blur)[0], blur)
    # Of the code that is loaded: a commit while it runs is another's.
    code, rows = store.provenance(), []
    with tempfile.TemporaryDirectory() as folder:
        given = Given(scene) if track == "T1" else FromVideo(scene)
        found = _found(given, Path(folder), scores.frame)
        for name in VIEWS:
            method = METHODS[name]
            own, cost = found.get((method.depth or NORMAL).name, (given, 0.0))
            if name in WARMED:
                # What is found of other frames once is no frame's cost, and shaders are compiled once.
                method.run(own.case(scores.frame, blur), 1)
            for views in judged_views(name, width):
                row = scores.row(track, own, name, views)
                if row.cpu_s is not None and method.depth is not None:
                    row = replace(row, cpu_s=row.cpu_s + cost)
                rows.append(row)
                print(report.line(row), flush=True)
    cameras = scene.stage.cameras
    return Curve(scene.name, track, (cameras.width, cameras.height), tuple(rows), code)


def judged_views(name: str, width: int) -> tuple[int, ...]:
    """Return the numbers of views with which a method is judged in pictures of a width."""
    if width <= LARGE:
        return VIEWS[name]
    return tuple(views for views in VIEWS[name] if views <= MOST_VIEWS and name != SLOW)


def _found(given: GroundTruth | FromVideo, folder: Path, frame: int) -> dict[str, tuple[FromVideo, float]]:
    """The clip with a frame's depth found and kept, and the CPU seconds that it takes in the mean, by
    quality; nothing where depth is given."""
    if isinstance(given, GroundTruth):
        return {}
    found = {}
    for quality in QUALITIES.values():
        video, cost = given.with_depth(quality, folder, frame)
        found[quality.name] = video, cost.cpu_s
        print(f"{given.scene.name}: depth of {quality.name} quality, {cost.cpu_s:.2f} CPU s a frame")
    return found


def put(folder: Path, made: Curve) -> None:
    """Write the results with a curve in its place, and table and plot of all."""
    file = folder / f"{NAME}.json"
    stored = json.loads(file.read_text()) if file.exists() else []
    curves = [
        Curve(one["scene"], one["track"], (one["size"][0], one["size"][1]),
              tuple(Row(**row) for row in one["rows"]), one["measured"])
        for one in stored
    ]  # fmt: skip
    by_key = {(each.size, each.scene, each.track): each for each in (*curves, made)}
    curves = [by_key[key] for key in sorted(by_key)]
    folder.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps([asdict(each) for each in curves], indent=1) + "\n")
    (folder / f"{NAME}.md").write_text(text(curves))
    panels = {each.title: [replace(row, psnr=_error(row)) for row in each.rows] for each in curves}
    title = "Error without clipped highlights over cost (small numbers: views)"
    report.draw(folder / f"{NAME}.png", title, panels)


def text(curves: list[Curve]) -> str:
    """Markdown: a table a curve, and where ours is not the upper one."""
    lines = [
        "# Error over cost of one frame", "",
        "`python -m benchmarks.special envelope`. PSNR in dB against a real lens, of one frame, without the"
        " truth's own noise; unclipped: where no clipped highlight reaches. Draft, normal and final choose"
        " their number of views, and normal draws pictures past 960 pixels smaller. Ours are "
        + ", ".join(OURS) + f". Past {LARGE} pixels of width no method has more than {MOST_VIEWS} views,"
        f" and {SLOW} is left out.",
    ]  # fmt: skip
    for each in curves:
        noise = f"the truth's noise: {each.rows[0].noise_ceiling:.1f} dB seed against seed"
        lines += ["", f"## {each.title}", f"{each.measured}; {noise}.", "", HEAD, "|---" * 7 + "|"]
        for row in each.rows:
            scores = row.psnr, row.edge_psnr, row.in_focus_psnr, row.unclipped_psnr, row.cpu_s
            cells = ["-" if score is None else f"{score:.2f}" for score in scores]
            lines.append(f"| {row.method} | {row.views or ''} | {' | '.join(cells)} |")
        lines += ["", f"Upper envelope: {each.envelope}."]
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    main()
