"""What is the user's lies where a run writes: it stays as it is, and the run names it or goes past it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from addon.core.media.clip import open_footage

from . import clip
from .bench import FRAMES, LENS, OTHER, Try, contents
from .kills import SIGNALS, interrupt, moment
from .mutations import mutate

MOVIE_FRAMES = "a.mp4.frames"
"""Folder in which a movie's frames lie until it is whole (`addon/render/output/movie_folder.py`)."""


def movie_folder(one: Try) -> None:
    """The folder of a movie's frames is there: somebody's files, frames of another run, a link to them, a
    file, or one that a run left and that has a stranger in it."""
    out, folder = one.folder / "out" / "a.mp4", one.folder / "out" / MOVIE_FRAMES
    words = ("render", one.bench.work, *LENS, "--out", out)
    kind = one.dice.choice(["files", "frames", "link", "file", "stranger", "edited"])
    theirs = one.folder / "theirs" if kind == "link" else folder
    theirs.parent.mkdir(exist_ok=True)
    if kind in ("files", "link"):
        (theirs / "sub").mkdir(parents=True)
        for name in one.dice.sample(["notes.txt", "sub/notes.txt", "000001.png", ".hidden"], 2):
            (theirs / name).write_text("precious")
    elif kind == "frames":
        one.run(
            "render", one.bench.work, *LENS, "--for-movie", "--frames", "3-6", "--out", theirs / "######.png"
        )
    elif kind == "file":
        theirs.write_text("precious")
    else:
        interrupt(one, one.start(*words), moment(one), one.dice.choice(SIGNALS))
        pictures = sorted(theirs.glob("*.png"))
        if not pictures or out.exists():
            return
        if kind == "edited":
            edit(one.dice.choice(pictures))
        else:
            (theirs / "notes.txt").write_text("precious")
    if kind == "link":
        out.parent.mkdir()
        folder.symlink_to(theirs)
    before = _here(theirs)
    run = one.run(*words)
    if _here(theirs) != before:
        one.verdict.add("lost", f"{kind}: {run.said[-300:]}")
    if run.status == 0 or out.exists():
        one.verdict.add("wrong", f"{kind}: not refused: {run.said[-300:]}")
    # Moved out of the way, it is as if nothing had been.
    folder.rename(one.folder / "moved")
    one.expect({"a.mp4": one.bench.movie}, out, one.run(*words))


NAMES = ("P{}.png", "{}.png", "desk_{}_v02.png", "take 2 #{}.png")
FIRST = (1, 1048570, 1100335, 20250101115958, 2**63)
"""Number of the first picture; Blender's last frame is 1048574. The true cameras (`clip.truth`) depend on
frame numbers, which then begin at 1."""


def names(one: Try) -> None:
    """A clip and its masks by the names that cameras and versions give, with the files of macOS beside them:
    the same pictures as by plain names."""
    name, first = one.dice.choice(NAMES), one.dice.choice(FIRST)
    rendered = []
    for kind, number in (("plain", 1), ("odd", first)):
        for what, source in (("clip", one.bench.clip.parent / "pictures"), ("masks", one.bench.masks)):
            folder = one.folder / kind / what
            folder.mkdir(parents=True)
            for place, file in enumerate(sorted(source.iterdir())):
                called = f"{1 + place:04d}.png" if kind == "plain" else name.format(number + place)
                (folder / called).write_bytes(file.read_bytes())
                if kind == "odd" and one.dice.random() < 0.5:
                    (folder / f"._{called}").write_bytes(b"\0\5\x16\7")
        clip_folder = one.folder / kind / "clip"
        work, out = clip.solve(clip_folder, one.folder / kind / "work"), one.folder / kind / "out"
        shown = open_footage(clip_folder).frames
        words = ("--mask", one.folder / kind / "masks", "--frames", f"{shown[2]}-{shown[3]}")
        run = one.run("render", work, *LENS, *words, "--out", out / "####.png")
        if run.status:
            one.verdict.add("lost", f"{name.format(first)}: {run.said[-300:]}")
            return
        rendered.append([np.asarray(cv2.imread(str(file))) for file in sorted(out.iterdir())])
    if not np.array_equal(rendered[0], rendered[1]):
        one.verdict.add("wrong", f"{name.format(first)}: other pictures than by plain names")


def edited_frame(one: Try) -> None:
    """A frame is edited after the render, with its notes kept: not gone on with, and not joined."""
    out = one.folder / "out" / "######.png"
    words = ("render", one.bench.work, *one.dice.choice([LENS, OTHER]), "--for-movie", "--out", out)
    one.run(*words)
    frame = out.with_name(f"{one.dice.randint(1, FRAMES):06d}.png")
    edit(frame)
    before = contents(out.parent)
    again = one.run(*words)
    joined = one.run("join", one.bench.work, "--rendered", out, "--out", one.folder / "a.mp4")
    for run in (again, joined):
        if run.status == 0 or "was changed after it was rendered" not in run.said:
            one.verdict.add("wrong", f"{frame.name} was edited: {run.said[-300:]}")
    if contents(out.parent) != before:
        one.verdict.add("lost", "the edited frame was replaced")


def own_report(one: Try) -> None:
    """A file of reports in the place of a solve's state, whole or damaged, a copy of it or a link to it."""
    work = one.bench.project(one.folder / "project")
    state, kind = work / "solve.json", one.dice.choice(["state", "damaged", "copy", "link"])
    path = state if kind in ("state", "damaged") else one.folder / "r.json"
    if kind == "damaged":
        state.write_bytes(mutate(one.dice, state.read_bytes()))
    elif kind == "copy":
        path.write_bytes(state.read_bytes())
    elif kind == "link":
        path.symlink_to(state)
    before = path.read_bytes()
    out = one.folder / "out" / "####.png"
    run = one.run("render", work, *LENS, "--out", out, "--report", path, "--overwrite")
    if path.read_bytes() != before or path.is_symlink() != (kind == "link"):
        one.verdict.add("lost", f"{kind}: the solve's state was replaced")
    if run.status == 0 or out.parent.exists():
        one.verdict.add("wrong", f"{kind}: not refused: {run.said[-300:]}")


def edit(path: Path) -> None:
    """Turn a PNG's colours round, and keep all that it says of itself, as editors do."""
    data = path.read_bytes()
    ours, new = (
        _chunks(data),
        _chunks(cv2.imencode(".png", cv2.bitwise_not(np.asarray(cv2.imread(str(path)))))[1].tobytes()),
    )
    kept = [chunk for chunk in ours if chunk[4:8] not in (b"IDAT", b"IEND")]
    pixels = [chunk for chunk in new if chunk[4:8] == b"IDAT"]
    path.write_bytes(b"".join([data[:8], *kept, *pixels, ours[-1]]))


def _chunks(png: bytes) -> list[bytes]:
    at, found = 8, []
    while at < len(png):
        end = at + 12 + int.from_bytes(png[at : at + 4])
        found.append(png[at:end])
        at = end
    return found


def _here(path: Path) -> dict[str, bytes]:
    return {"": path.read_bytes()} if path.is_file() else contents(path)
