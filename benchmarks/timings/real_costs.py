"""What real clips cost from command to written file: `python -m benchmarks.special real_costs`.

Each clip is solved, and its middle frames are rendered, by the command line in processes of their own. One
frame is rendered with its depth to find, then more frames; the same frames again with their depth kept and
another focus. A next frame costs the difference by the number of frames. A clip named with a width is scaled
to it first. Clips that are not there are left out, and named.
"""

from __future__ import annotations

import argparse
import os
import pstats
import shutil
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import av
import cv2
import numpy as np

from addon.core.media.clip import open_footage

from .. import store
from ..gallery.clips import DATA
from .whole_runs import HEADLESS, Run, a_frame, timed_process

CLIPS = (
    "clips/person_walk_away_1.mp4", "clips/people_two_talk_street_1.mp4", "duck/demo.mp4", "clips/dog.mp4",
    "clips/still_roof_hlg10_rot_1.mp4", "clips/dog.mp4@3840",
)  # fmt: skip
"""960x540, 1920x1080 (a camera that stays), 884x1080, 1280x720, 1080x1920, and 4K."""
SCALED_FRAMES = 48
"""Frames of a scaled clip, at most."""
MORE = 3
"""Frames after the first one."""
BLUR = 0.03
PARTS = 14
"""Modules listed of a profile."""
HEADS = "| clip | run | frames | wall, s | CPU s | CPU s a frame | peak, MB |"


@dataclass(frozen=True)
class RealClip:
    """A clip and its working folder."""

    file: Path
    folder: Path
    frames: int
    size: tuple[int, int]
    program: Path

    @property
    def name(self) -> str:
        return f"{self.file.stem} ({self.size[0]}x{self.size[1]})"

    @property
    def work(self) -> Path:
        return self.folder / "work"

    def solve(self, profiles: Path | None = None) -> Run:
        """Solve the clip into a new folder."""
        shutil.rmtree(self.work, ignore_errors=True)
        return self.run("solve", profiles, self.file, "--work", self.work)

    def render(self, count: int, focus: tuple[float, float], profiles: Path | None = None) -> Run:
        """Render frames from the middle on."""
        middle = self.frames // 2
        out = self.folder / "out"
        shutil.rmtree(out, ignore_errors=True)
        at = f"{focus[0]},{focus[1]}@{middle}"
        words = ("--focus-at", at, "--blur", BLUR, "--frames", f"{middle}-{middle + count - 1}")
        return self.run("render", profiles, self.work, *words, "--out", out / "####.png")

    def forget(self) -> None:
        """Remove what is kept beside the solve."""
        shutil.rmtree(self.work / "depth", ignore_errors=True)

    def run(self, what: str, profiles: Path | None, *words: object) -> Run:
        """Run a command of the program; its profiles go to a folder if there is one."""
        environment = dict(os.environ)
        if profiles is not None:
            profiles.mkdir(parents=True)
            environment["VIRTUAL_APERTURE_PROFILES"] = str(profiles)
            environment["PYTHONPATH"] = str(Path(__file__).with_name("profiled"))
        command = [sys.executable, self.program, what, *words]
        return timed_process(command, self.folder / "log.txt", environment=environment)


def opened(name: str, folder: Path, program: Path) -> RealClip | None:
    """The clip of a name in the real data, scaled if the name has a width; None if it is not there."""
    stored, _, width = name.partition("@")
    file = DATA / stored
    if not file.exists():
        return None
    folder.mkdir()
    if width:
        file = scaled(file, folder / f"{file.stem}.mp4", int(width))
    clip = open_footage(file)
    return RealClip(file, folder, len(clip.frames), (clip.width, clip.height), program)


def scaled(file: Path, out: Path, width: int) -> Path:
    """The first frames of a clip as H.264, scaled to a width by cubic interpolation."""
    clip = open_footage(file)
    size = width, 2 * round(clip.height * width / clip.width / 2)
    with av.open(str(out), "w") as written:
        stream = written.add_stream("libx264", rate=24, options={"crf": "16"})
        (stream.width, stream.height), stream.pix_fmt = size, "yuv420p"
        # BT.709, as cameras say it.
        context = stream.codec_context
        context.colorspace = context.color_primaries = context.color_trc = context.color_range = 1
        for frame in clip.frames[:SCALED_FRAMES]:
            large = cv2.resize(clip.read(frame)[..., :3], size, interpolation=cv2.INTER_CUBIC)
            picture = av.VideoFrame.from_ndarray(np.asarray(large, np.uint8), "rgb24")
            coded = picture.reformat(format="yuv420p", dst_colorspace=1, dst_color_range=1)
            written.mux(stream.encode(coded))
        written.mux(stream.encode())
    return out


def rows(clip: RealClip, profiles: Path | None) -> Iterator[str]:
    """Rows of a clip; profiles by stage after them if there is a folder."""

    solved = clip.solve()
    yield _row(clip, "solve", clip.frames, solved, solved.cpu_s / clip.frames)
    for run, focus in (("depth to find", (0.5, 0.5)), ("depth kept, another focus", (0.4, 0.6))):
        first = clip.render(1, focus)
        yield _row(clip, f"{run}, first frame", 1, first, first.cpu_s)
        if run == "depth to find":
            clip.forget()
        more = clip.render(1 + MORE, focus)
        yield _row(clip, f"{run}, each next", MORE, more, a_frame((first, more), MORE)[1])
    if profiles is not None:
        yield from profiled(clip, profiles / f"{clip.file.stem}-{clip.size[0]}")


def profiled(clip: RealClip, folder: Path) -> Iterator[str]:
    """Run a clip once more under the profiler; a line by stage, whose profiles are kept in a folder."""
    clip.solve(folder / "solve")
    for stage, count in (("first", 1), ("next", 1 + MORE), ("kept", 1 + MORE)):
        clip.render(count, (0.5, 0.5), folder / stage)
    for stage in ("solve", "first", "next", "kept"):
        yield from stages(f"{clip.name}, {stage}", folder / stage)


def _row(clip: RealClip, run: str, frames: int, cost: Run, each: float) -> str:
    return (
        f"| {clip.name} | {run} | {frames} | {cost.wall_s:.1f} | {cost.cpu_s:.1f} | {each:.2f} |"
        f" {cost.peak_mb:.0f} |"
    )


def stages(title: str, folder: Path) -> Iterator[str]:
    """Seconds by module of the add-on, library calls counted for the module that makes them."""
    seconds: dict[str, float] = defaultdict(float)
    for file in folder.glob("*.prof"):
        for module, spent in own_seconds(pstats.Stats(str(file))).items():
            seconds[module] += spent
    whole = sum(seconds.values())
    listed = sorted(seconds.items(), key=lambda item: -item[1])[:PARTS]
    yield f"{title}: {whole:.1f} s under the profiler, of which " + ", ".join(
        f"{module} {100 * spent / whole:.0f} %" for module, spent in listed
    )


def own_seconds(profile: pstats.Stats) -> dict[str, float]:
    """Seconds by module of the add-on; those of library functions go to their callers by their shares."""
    table = profile.stats  # type: ignore[attr-defined]
    owned: dict[str, float] = defaultdict(float)
    pending = {function: entry[2] for function, entry in table.items()}
    for _ in range(60):
        passed: dict[object, float] = defaultdict(float)
        for function, spent in pending.items():
            module = _module(function[0])
            callers = table[function][4]
            shares = {caller: max(entry[3], 1e-12) for caller, entry in callers.items() if caller != function}
            if module or not shares:
                owned[module or "start and end"] += spent
                continue
            total = sum(shares.values())
            for caller, share in shares.items():
                passed[caller] += spent * share / total
        pending = passed  # type: ignore[assignment]
        if sum(pending.values()) < 1e-3:
            break
    owned["start and end"] += sum(pending.values())
    return owned


def _module(file: str) -> str:
    """A file of the add-on below its folder; empty for other files."""
    _, found, name = file.replace(os.sep, "/").rpartition("/addon/")
    return name.removesuffix(".py") if found else ""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--clips", nargs="+", default=CLIPS, metavar="FILE[@WIDTH]", help="in the real data")
    parser.add_argument("--profiles", type=Path, help="folder for a profile of each stage, made anew")
    parser.add_argument("--program", type=Path, default=HEADLESS, help="addon/headless.py of a checkout")
    options = parser.parse_args()
    print(f"blur {BLUR:g}, {os.cpu_count()} processors, {store.provenance()}")
    print(HEADS, "|" + "---|" * (HEADS.count("|") - 1), sep="\n", flush=True)
    with tempfile.TemporaryDirectory(prefix="virtual-aperture-bench-") as folder:
        for number, name in enumerate(options.clips):
            clip = opened(name, Path(folder) / str(number), options.program.absolute())
            if clip is None:
                print(f"not there: {name}", file=sys.stderr)
                continue
            for line in rows(clip, options.profiles):
                print(line, flush=True)
            shutil.rmtree(clip.folder)


if __name__ == "__main__":
    main()
