"""Options that mean nothing, and streams that nobody reads: one line of error, or the work is done."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.camera.reconstruction import Intrinsics
from addon.core.readers.colmap_export import write_model
from addon.core.sfm.process import SolveProcess

from ..scenes import slanted_plane, write_frames
from ..waiting import PATIENCE

HEADLESS = Path(__file__).resolve().parents[2] / "addon" / "headless.py"
LENS = Intrinsics(160, 90, 140.0, 140.0, 80.0, 45.0)
FRAMES = tuple(range(1, 7))
FOCUS = ("--focus-distance", "6", "--method", "features", "--views", "2")

Shared = Callable[[str, Callable[[Path], object]], Path]


@pytest.fixture(scope="module")
def work(registered: None, shared: Shared) -> Path:
    """The working folder of a clip of a plane."""

    def fill(folder: Path) -> None:
        footage = write_frames(folder / "clip", LENS, FRAMES)
        (folder / "model").mkdir()
        write_model(folder / "model", slanted_plane(LENS, FRAMES, count=400))
        words = ("import", folder / "model", "--footage", footage, "--work", folder / "work")
        assert run_command([str(each) for each in words]) == 0

    return shared("hostile", fill) / "work"


def refusal(capfd: pytest.CaptureFixture[str], *words: object) -> str:
    """The one line with which a command is refused."""
    capfd.readouterr()
    status = run_command([str(word) for word in words])
    lines = [line for line in capfd.readouterr().err.splitlines() if "EGL" not in line]
    assert len(lines) == 1 and lines[0].startswith("error: ") and "--debug" not in lines[0], lines
    # 2 says that the arguments were not understood.
    assert status == (2 if lines[0].endswith("--help") else 1)
    return lines[0]


def lens(*words: str) -> tuple[str, ...]:
    """A lens with one of its options replaced."""
    if words[0] in ("--focus-point", "--focus-plane", "--focus-distance", "--focus-at"):
        return ("--method", "features", *words)
    return (*FOCUS, *words)


WRONG = [
    (("--frames", "1-4:0"), "the frame step is 0"),
    (("--frames", "3-1"), "no frames 3-1"),
    (("--views", "1_0"), "'1_0' is not a whole number; it can also be auto"),
    (("--views", "1000000000"), "views cannot be 1000000000; give a number from 0 to 4096"),
    (("--focus-point", "9" * 20), "is not from 0 to"),
    (("--focus-distance", "1e-300"), "too small"),
    (("--focus-at", "nan,0.5"), "is not valid"),
    (("--aperture", "image="), "name is empty"),
    (("--aperture", "coma=\u0661"), "is not a number"),
    (("--jobs", "1000000000"), "is not from 1 to 1000"),
    (("--highlights", "nan"), "is not a number; it can also be off"),
    (("--highlight-threshold", "97"), "clipping threshold cannot be 97; give a number from 0.1 to 1"),
    (("--tilt", "1e400"), "is not a number"),
]
"""Each parser with something that it refuses; numbers themselves are tested in tests/base/test_numbers.py."""


@pytest.mark.parametrize(("words", "why"), WRONG)
def test_a_number_that_means_nothing_is_refused(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], words: tuple[str, ...], why: str
) -> None:
    out = tmp_path / "o" / "####.png"
    assert why in refusal(capfd, "render", work, *lens(*words), "--out", out)
    assert not out.parent.exists()


def test_a_focal_length_that_no_lens_has_is_refused_before_the_solve(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words = ("solve", work.parent / "clip", "--work", tmp_path / "w", "--focal", "272000")
    assert "lenses have 5 to 4000" in refusal(capfd, *words)
    assert not (tmp_path / "w").exists()


@pytest.mark.parametrize(
    "words",
    [("render", "DIR"), ("no-such-command",), ("render", "DIR", "--out", "", "--focus-at", "0,0"),
     ("render", "a\nb", "--out", "####.png", "--focus-at", "0,0"), ()],
)  # fmt: skip
def test_words_that_are_not_understood_are_one_line(
    registered: None, capfd: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    refusal(capfd, *words)


def folder(path: Path) -> None:
    path.mkdir()


def loop(path: Path) -> None:
    path.symlink_to(path.name)


def nowhere(path: Path) -> None:
    path.symlink_to("is/not/there")


@pytest.mark.parametrize(
    ("made", "place"), [(folder, "o.mp4"), (loop, "0002.png"), (os.mkfifo, "0002.png"), (nowhere, "r.json")]
)
def test_a_file_that_cannot_be_written_is_refused_before_the_work(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], made: Callable[[Path], None], place: str
) -> None:
    made(tmp_path / place)
    out = tmp_path / (place if place == "o.mp4" else "####.png")
    words = ["render", work, *FOCUS, "--frames", "1-2", "--out", out, "--overwrite"]
    words += ["--report", tmp_path / place] if place == "r.json" else []
    assert place in refusal(capfd, *words)
    assert [path.name for path in tmp_path.iterdir()] == [place]


@pytest.mark.parametrize(("made", "place"), [(nowhere, "o.mp4.frames"), (loop, "there")])
def test_a_folder_that_cannot_be_one_is_refused_before_the_work(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], made: Callable[[Path], None], place: str
) -> None:
    made(tmp_path / place)
    out = tmp_path / "o.mp4" if place == "o.mp4.frames" else tmp_path / place / "below" / "####.png"
    assert place in refusal(capfd, "render", work, *FOCUS, "--out", out)
    assert [path.name for path in tmp_path.iterdir()] == [place]


def test_a_blend_that_cannot_be_written_is_refused(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    loop(tmp_path / "a.blend")
    assert "a.blend" in refusal(capfd, "save", work, "--blend", tmp_path / "a.blend", "--overwrite")
    assert [path.name for path in tmp_path.iterdir()] == ["a.blend"]


@pytest.mark.parametrize("value", [np.inf, np.nan])
def test_a_picture_of_the_aperture_that_is_not_finite_is_refused(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], value: float
) -> None:
    light = np.ones((32, 32), np.float32)
    light[4, 5] = value
    cv2.imwrite(str(tmp_path / "hole.tif"), light)
    words = (*FOCUS, "--aperture", f"image={tmp_path / 'hole.tif'}")
    assert "not finite" in refusal(capfd, "render", work, *words, "--out", tmp_path / "o" / "####.png")


def test_a_slit_is_an_aperture_however_thin_its_picture_is(work: Path, tmp_path: Path) -> None:
    across = {}
    for size in ((1, 5000), (5000, 1), (1, 40000)):
        cv2.imwrite(str(tmp_path / "slit.png"), np.full(size, 255, np.uint8))
        shape = ("--blur", "0.1", "--aperture", f"image={tmp_path / 'slit.png'}")
        out = tmp_path / str(size) / "####.png"
        words = ("render", work, *FOCUS[:-1], "24", *shape, "--frames", "2", "--out", out)
        assert run_command([str(each) for each in words]) == 0
        shown = cv2.imread(str(out.parent / "0002.png")).astype(float)
        # The detail that is left across and down.
        across[size] = np.abs(np.diff(shown, axis=1)).mean() / np.abs(np.diff(shown, axis=0)).mean()
    assert across[5000, 1] > 1.5 * across[1, 5000]
    assert across[1, 40000] == pytest.approx(across[1, 5000], rel=0.01)


def headless(words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A command line as a shell runs it, with the program as $VA."""
    return subprocess.run(
        ["bash", "-c", words], capture_output=True, text=True, check=False, cwd=folder,
        env=os.environ | {"VA": f"{sys.executable} {HEADLESS}"},
    )  # fmt: skip


RENDER = " ".join(("$VA render WORK", *FOCUS, "--frames 2-3 --out o/####.png"))


@pytest.mark.long
@pytest.mark.parametrize(
    "shell",
    ["RENDER <&- >&- 2>&-", "RENDER | head -1; exit ${PIPESTATUS[0]}",
     "RENDER 2>&1 | true; exit ${PIPESTATUS[0]}"],
)  # fmt: skip
def test_a_render_is_finished_where_nobody_listens(work: Path, tmp_path: Path, shell: str) -> None:
    done = headless(shell.replace("RENDER", RENDER).replace("WORK", str(work)), tmp_path)
    assert (done.returncode, [line for line in done.stderr.splitlines() if "EGL" not in line]) == (0, [])
    assert sorted(path.name for path in (tmp_path / "o").iterdir()) == ["0002.png", "0003.png"]
    assert cv2.imread(str(tmp_path / "o" / "0002.png")).shape == (90, 160, 3)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a disk that is always full")
def test_words_that_a_full_disk_lost_are_no_success(work: Path, tmp_path: Path) -> None:
    done = headless(f"$VA report {work} --json > /dev/full", tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith("error: standard output cannot be written: No space left")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("program", ["", pytest.param("nohup", marks=pytest.mark.long)])
def test_a_hangup_ends_it_with_a_line_unless_it_is_ignored(work: Path, tmp_path: Path, program: str) -> None:
    words = [sys.executable, HEADLESS, "render", work, *FOCUS[:-1], "1024", "--out", "o/####.png"]
    process = subprocess.Popen(
        [program] * bool(program) + [str(word) for word in words], cwd=tmp_path, text=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        # The tests themselves may run under nohup.
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    )  # fmt: skip
    assert process.stdout is not None
    while not process.stdout.readline().startswith("rendering"):
        assert process.poll() is None
    process.send_signal(signal.SIGHUP)
    _, errors = process.communicate(timeout=PATIENCE)
    lines = [line for line in errors.splitlines() if "EGL" not in line and "nohup" not in line]
    expected = (0, []) if program else (129, ["error: interrupted; finished frames are kept"])
    assert (process.returncode, lines) == expected


@pytest.mark.long
def test_run_solves_the_whole_clip_and_renders_what_is_asked_for(
    registered: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from benchmarks.torture.clip import write_walk

    solved = []
    monkeypatch.setattr(
        "addon.cli.solve.SolveProcess",
        lambda *arguments, **named: solved.append(SolveProcess(*arguments, **named)) or solved[-1],
    )
    walk = write_walk(tmp_path / "walk")
    lens = ("--focus-distance", "9", "--method", "features", "--views", "2")
    words = ("run", walk, *lens, "--frames", "1-11:5", "--out", tmp_path / "o" / "####.png")
    assert run_command([str(each) for each in words]) == 0
    assert sorted(path.name for path in (tmp_path / "o").glob("*.png")) == [
        "0001.png",
        "0006.png",
        "0011.png",
    ]
    assert solved[0].clip.frames == tuple(range(1, 13))
    # Another range needs no other solve.
    words = ("run", walk, *lens, "--frames", "4", "--out", tmp_path / "o" / "####.png")
    began = time.time()
    assert run_command([str(each) for each in words]) == 0
    assert (tmp_path / "o" / "walk.aperture" / "solve.json").stat().st_mtime < began


def test_run_refuses_frames_that_the_clip_does_not_have_before_it_solves(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words = ("run", work.parent / "clip", *FOCUS, "--frames", "7-9", "--out", tmp_path / "o" / "####.png")
    assert "no frames 7-9; it has frames 1 to 6" in refusal(capfd, *words)
    assert not (tmp_path / "o").exists()


def test_an_import_of_another_clip_s_model_is_told(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "model"
    model.mkdir()
    plane = slanted_plane(LENS, FRAMES, count=400)
    rng = np.random.default_rng(1)
    for image in plane.images:
        image.xy[:] = rng.uniform([0, 0], [LENS.width, LENS.height], image.xy.shape)
    write_model(model, plane)
    words = ("import", model, "--footage", work.parent / "clip", "--work", tmp_path / "w")
    assert run_command([str(each) for each in words]) == 0
    said = capfd.readouterr().out
    assert "advice: renders will be wrong: these cameras miss the clip by" in said
    assert "another take or lens?" in said


def test_a_focus_nearer_than_anything_is_refused_by_its_option(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "o" / "####.png"
    words = ("--method", "features", "--views", "2", "--out", out, "--frames", "3")
    for distance in ("1e-9", "0.01"):
        said = refusal(capfd, "render", work, "--focus-distance", distance, *words)
        assert f"the focus distance is {float(distance):g}, but nothing in the clip is nearer than" in said
        least = said.split("give a distance from ")[1].split()[0]
    assert not out.parent.exists()
    done = run_command([str(each) for each in ("render", work, "--focus-distance", least, *words)])
    assert done == 0 and out.with_name("0003.png").exists()


@pytest.mark.parametrize("option", ["--focus-distance", "--blur", "--aperture-radius"])
def test_a_length_of_nothing_is_refused_by_its_option(
    work: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], option: str
) -> None:
    words = [*FOCUS, "--out", tmp_path / "####.png", "--frames", "3", option, "0"]
    words = words[2:] if option == "--focus-distance" else words
    assert f"{option} is 0; it must be greater than zero" in refusal(capfd, "render", work, *words)
