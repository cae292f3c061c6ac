"""The command line, as people run it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.torture import clip

from .. import planes
from ..command_line import done, headless, here
from ..movies import frames_of_sound

ROOT = Path(__file__).resolve().parents[2]
CLIP = ROOT / "sample_scenes" / "desk.mp4"
FOCUS = "0.528,0.458"
"""The globe in the middle frames of the sample clip."""
TRACKED = "0.476,0.16"
"""Where the tiny clip has many points."""

pytestmark = pytest.mark.usefixtures("registered")


@pytest.fixture(scope="module")
def work(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny clip of 12 frames with sound, solved without solving."""
    folder = tmp_path_factory.mktemp("tiny")
    return clip.solve(clip.write_video(folder / "clip", 12), folder / "work")


@pytest.mark.long
def test_the_sample_clip_is_solved_whole(desk_work: Path) -> None:
    """At half its size, in a process of its own (`conftest.desk_work`)."""
    assert "36 of 36 frames registered" in desk_work.with_name("said.txt").read_text()


def sharpness(picture: np.ndarray) -> float:
    return float(cv2.Laplacian(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY).astype(float), cv2.CV_64F).var())


@pytest.mark.long
def test_a_movie_with_rate_sound_and_a_sharp_subject(desk_work: Path, desk: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.mp4"
    lens = ("--focus-at", FOCUS, "--blur", 0.04, "--views", 16)
    ended = headless("render", desk_work, *lens, "--frames", "16-21", "--out", out)
    assert ended.returncode == 0, ended.stderr
    assert "6 of 6" in ended.stdout and "left" in ended.stdout
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.mp4"]
    before, after = cv2.VideoCapture(str(desk)), cv2.VideoCapture(str(out))
    assert after.get(cv2.CAP_PROP_FPS) == pytest.approx(24)
    for _ in range(15):
        before.read()
    count = 0
    while (shown := after.read())[0]:
        picture, source = shown[1], before.read()[1]
        count += 1
        assert picture.shape == source.shape
        subject, wall = np.s_[70:95, 158:182], np.s_[5:40, 100:220]
        assert sharpness(picture[subject]) > 0.5 * sharpness(source[subject])
        assert sharpness(picture[wall]) < 0.3 * sharpness(source[wall])
        # No dark and no frozen border.
        for edge in (np.s_[:2], np.s_[-2:], np.s_[:, :2], np.s_[:, -2:]):
            assert picture[edge].mean() > 0.8 * source[edge].mean()
    assert count == 6
    assert abs(frames_of_sound(out) - 6) <= 2


def test_a_sequence_goes_on_where_it_stopped(work: Path, tmp_path: Path) -> None:
    lens = ("render", work, "--focus-distance", 6, "--views", 4, "--method", "features", "--frames", "3-9:3")
    out = tmp_path / "frames" / "####.png"
    done(*lens, "--out", out)
    names = ["0003.png", "0006.png", "0009.png"]
    assert sorted(p.name for p in out.parent.glob("*.png")) == names
    stamp = (out.parent / "0003.png").stat().st_mtime_ns
    (out.parent / "0006.png").unlink()
    assert "2 frames there already" in done(*lens, "--out", out)
    assert (out.parent / "0003.png").stat().st_mtime_ns == stamp
    assert sorted(p.name for p in out.parent.glob("*.png")) == names
    other = here(*lens, "--blur", 0.05, "--out", out)
    assert other.returncode == 1 and "other settings" in other.stderr
    done(*lens, "--blur", 0.05, "--out", out, "--overwrite")
    assert (out.parent / "0003.png").stat().st_mtime_ns != stamp


@pytest.mark.long
def test_gaps_and_odd_sizes_go_through(tmp_path: Path) -> None:
    shot = tmp_path / "shot"
    shot.mkdir()
    for number, picture in enumerate(planes.halved(planes.sideways(16)), 101):
        if number not in (110, 111, 112):
            cv2.imwrite(str(shot / f"img_{number:05d}.png"), picture[:119, :159])
    lens = ("--focus-at", FOCUS, "--views", 2)
    fast = (*lens, "--method", "features")
    solve = ("run", shot / "img_#####.png", "--focal", planes.FOCAL / 2)
    done(*solve, *fast, "--out", tmp_path / "o" / "####.png")
    numbers = [int(p.stem) for p in sorted((tmp_path / "o").glob("*.png"))]
    assert numbers == [*range(101, 110), *range(113, 117)]
    assert cv2.imread(str(tmp_path / "o" / "0113.png")).shape == (119, 159, 3)
    work = next((tmp_path / "o").glob("*.aperture"))
    # Whose neighbours lie beyond the gap.
    done("render", work, *lens, "--frames", "109-113", "--out", tmp_path / "p" / "####.png")
    assert sorted(p.name for p in (tmp_path / "p").iterdir()) == ["0109.png", "0113.png"]
    done("render", work, *fast, "--out", tmp_path / "a.mp4")
    movie = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    # The gap is held, so that time stays right; H.264 needs even sizes.
    sizes = (cv2.CAP_PROP_FRAME_COUNT, cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
    assert [int(movie.get(p)) for p in sizes] == [16, 158, 118]


def test_bad_input_is_one_line_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = tmp_path / "in"
    empty, mixed, one, same = (given / name for name in ("empty", "mixed", "one", "same"))
    for folder in (empty, mixed, one, same):
        folder.mkdir(parents=True)
    picture = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    cv2.imwrite(str(mixed / "1.png"), picture)
    for number in (2, 3, 4):
        cv2.imwrite(str(mixed / f"{number}.png"), picture[:40])
    cv2.imwrite(str(one / "0001.png"), picture)
    for number in range(5):
        cv2.imwrite(str(same / f"{number}.png"), cv2.resize(picture, (320, 240)))
    (given / "text.mp4").write_text("not a video\n" * 50)
    (given / "file").touch()
    monkeypatch.chdir(tmp_path)
    before = sorted(str(path) for path in given.rglob("*"))
    for words, out, message in (
        (("run", given / "nope.mp4"), "o.mp4", "nope.mp4 does not exist"),
        (("run", empty), "o.mp4", "has no images"),
        (("run", one), "o.mp4", "at least 4"),
        (("run", same), "o.mp4", "does not move"),
        (("run", mixed), "o.mp4", "2.png is 64x40, the clip is 64x48"),
        (("run", given / "text.mp4"), "o.mp4", "not a video that can be read"),
        (("run", CLIP), "file/o.mp4", "cannot be written"),
        (("run", CLIP), "o.gif", "o.gif is not a known output format"),
        (("run", CLIP), "o.png", "write ####.png"),
        (("run", CLIP, "--frames", "90-99"), "o.mp4", "has no frames 90-99"),
        (("render", empty), "o.mp4", "holds no solve"),
    ):
        ended = (headless if "nope" in message else here)(
            *words, "--focus-at", "0.5,0.5", "--out", given / out
        )
        said = [line for line in ended.stderr.splitlines() if line and "EGL" not in line]
        assert len(said) == 1 and said[0].startswith("error: ") and message in said[0], ended.stderr
        # 2 says that the arguments were not understood.
        assert ended.returncode == (2 if said[0].endswith("--help") else 1)
        assert sorted(str(path) for path in given.rglob("*")) == before
        assert sorted(path.name for path in tmp_path.iterdir()) == ["in"]


def test_the_folder_of_another_clip_is_left_alone(work: Path, tmp_path: Path) -> None:
    state = (work / "solve.json").read_text()
    other = tmp_path / "other"
    other.mkdir()
    for number in range(1, 5):
        cv2.imwrite(str(other / f"{number}.png"), np.full((48, 64, 3), number * 20, np.uint8))
    ended = here("solve", other, "--work", work)
    assert ended.returncode == 1 and "holds the solve of clip.mp4, not of other" in ended.stderr
    assert (work / "solve.json").read_text() == state


def test_output_that_exists_is_not_overwritten(work: Path, tmp_path: Path) -> None:
    out = tmp_path / "mine.mp4"
    out.write_text("mine")
    ended = here("render", work, "--focus-at", TRACKED, "--out", out)
    assert ended.returncode == 1 and "--overwrite" in ended.stderr
    assert out.read_text() == "mine"


def test_without_a_gpu_driver_it_says_what_to_install(work: Path, tmp_path: Path) -> None:
    out = tmp_path / "####.png"
    words = ("render", work, "--focus-at", TRACKED, "--views", 4, "--frames", 5, "--out", out)
    ended = headless(*words, environment={"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"})
    assert ended.returncode == 1 and "Traceback" not in ended.stderr
    assert "without a GPU context" in ended.stderr and "libegl1" in ended.stderr
    assert not list(tmp_path.glob("*.png"))
