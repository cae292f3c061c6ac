"""Rendering by many: shares of one machine, a farm's job, and a project that is sent away."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.media.clip import FrameRange, open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import
from addon.render.processes import jobs
from benchmarks.timings.workers import tasks
from benchmarks.torture import clip
from benchmarks.torture.bench import contents, file_limit

from ..command_line import HEADLESS, done, headless, here, words_of
from ..movies import assert_same, frames_of_sound
from ..waiting import until

ROOT = Path(__file__).resolve().parents[2]
LENS = ("--focus-distance", "7", "--blur", "0.05", "--method", "features", "--views", "4")
COUNT = 48

pytestmark = pytest.mark.usefixtures("registered")


def start(*arguments: object, temporary: Path) -> subprocess.Popen[str]:
    """A command in a session of its own, to be ended, with its folder for temporary files."""
    temporary.mkdir()
    return subprocess.Popen(
        [sys.executable, str(HEADLESS), *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env=os.environ | {"PYTHONUNBUFFERED": "1", "TMPDIR": str(temporary)},
        start_new_session=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def work(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A tiny clip of 48 frames with sound, its solve, and one machine's frames and movie."""
    folder = tmp_path_factory.mktemp("farm")
    clip.solve(clip.write_video(folder / "clip", COUNT), folder / "work")
    done("render", folder / "work", *LENS, "--for-movie", "--out", folder / "frames" / "######.png")
    done("render", folder / "work", *LENS, "--out", folder / "one.mp4")
    return folder / "work"


@pytest.mark.long
def test_a_job_on_two_workers_one_of_which_is_killed(work: Path, tmp_path: Path) -> None:
    said = done("farm", work, *LENS, "--chunk", 12, "--out", tmp_path / "job")
    assert "48 frames in 4 tasks" in said
    # Another machine has another path, and nothing but the bundle.
    bundle = tmp_path / "elsewhere" / "a job"
    bundle.parent.mkdir()
    (tmp_path / "job").rename(bundle)
    template = (bundle / "template.json").read_text()
    assert str(work.parent) not in template and "--blur" not in template and "--focus" not in template
    steps = tasks(json.loads((bundle / "template.json").read_text()), bundle)
    assert list(steps) == ["Render", "Join"] and len(steps["Render"]) == 4

    def begin(words: list[str]) -> subprocess.Popen[bytes]:
        return subprocess.Popen(words, stdout=subprocess.DEVNULL)

    frames = bundle / "output" / "frames"
    one, two = map(begin, steps["Render"][:2])
    while not list(frames.glob("*.png")):
        assert one.poll() in (0, None)
        time.sleep(0.01)
    two.kill()
    assert two.wait() == -signal.SIGKILL and one.wait() == 0
    # Joined too early, it says what is missing, and there is no movie.
    early = here(*words_of(steps["Join"][0]))
    assert early.returncode == 1 and "is missing" in early.stderr
    assert not (bundle / "output" / "movie.mp4").exists()
    again = begin(steps["Render"][1])
    done(*words_of(steps["Render"][2]))
    assert again.wait() == 0
    done(*words_of(steps["Render"][3]))
    done(*words_of(steps["Join"][0]))
    assert contents(frames) == contents(work.parent / "frames")
    movie = bundle / "output" / "movie.mp4"
    assert_same(movie, work.parent / "one.mp4")
    assert frames_of_sound(movie) > COUNT / 2


def test_the_job_is_an_open_job_description(work: Path, tmp_path: Path) -> None:
    if not (openjd := shutil.which(os.environ.get("OPENJD", "openjd"))):
        pytest.skip("no openjd program (pip install openjd-cli, or OPENJD names it)")
    done("farm", work, *LENS, "--frames", "5-10", "--chunk", 2, "--out", tmp_path / "job")
    template = tmp_path / "job" / "template.json"
    subprocess.run([openjd, "check", str(template)], check=True, capture_output=True)
    words = [openjd, "run", str(template), "--step", "Join", "--run-dependencies"]
    subprocess.run(words, check=True, capture_output=True)
    names = sorted(path.name for path in (tmp_path / "job" / "output" / "frames").iterdir())
    assert names == [f"{frame:06d}.png" for frame in range(5, 11)]


def test_a_job_that_solves_first_gives_what_one_machine_gives(desk: Path, tmp_path: Path) -> None:
    """From the clip to the movie with sound, by the real scheduler: 36 frames in 4 tasks."""
    if not (openjd := shutil.which(os.environ.get("OPENJD", "openjd"))):
        pytest.skip("no openjd program (pip install openjd-cli, or OPENJD names it)")
    lens = ("--focus-at", "0.5,0.55", "--blur", "0.03", "--method", "features", "--views", "4")
    assert "36 frames in 4 tasks" in done("farm", desk, *lens, "--chunk", 9, "--out", tmp_path / "job")
    words = [openjd, "run", str(tmp_path / "job" / "template.json"), "--step", "Join", "--run-dependencies"]
    subprocess.run(words, check=True, capture_output=True)
    work = tmp_path / "one"
    done("solve", desk, "--work", work)
    done("render", work, *lens, "--for-movie", "--out", tmp_path / "frames" / "######.png")
    done("render", work, *lens, "--out", tmp_path / "one.mp4")
    output = tmp_path / "job" / "output"
    assert contents(output / "frames") == contents(tmp_path / "frames")
    assert_same(output / "movie.mp4", tmp_path / "one.mp4")
    assert frames_of_sound(output / "movie.mp4") > 18


def test_bundles_are_refused_before_anything_is_written(work: Path, tmp_path: Path) -> None:
    for words, message in (
        (("--out", work), "exists"),
        (("--out", tmp_path / "b", "--movie", "a.png"), "not a movie name"),
        (("--out", tmp_path / "b", "--chunk", 0), "--chunk: 0 is not from 1 to"),
        (("--out", tmp_path / "b", "--frames", "900-901"), "no frames"),
    ):
        ended = here("farm", work, *LENS, *words)
        assert ended.returncode in (1, 2) and message in ended.stderr and "Traceback" not in ended.stderr
        assert not list(tmp_path.iterdir())


def test_jobs_give_what_one_process_gives(work: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.mp4"
    said = done("render", work, *LENS, "--out", out, "--jobs", 2)
    assert_same(out, work.parent / "one.mp4")
    assert "48 of 48" in said and contents(tmp_path).keys() == {"a.mp4"}
    # One process knows how it drew its own.
    assert "24 frames" not in said
    done("render", work, *LENS, "--frames", "3-30:9", "--jobs", 2, "--out", tmp_path / "s" / "######.png",
         "--report", tmp_path / "r.json")  # fmt: skip
    names = {f"{frame:06d}.png" for frame in (3, 12, 21, 30)}
    reference = contents(work.parent / "frames")
    assert contents(tmp_path / "s") == {name: reference[name] for name in names}
    entries = json.loads((tmp_path / "r.json").read_text())["frames"]
    assert [entry["frame"] for entry in entries] == [3, 12, 21, 30]


def test_jobs_render_the_frames_of_a_solve_with_a_step(work: Path, tmp_path: Path) -> None:
    """Also where frames are there already, so that those that are left are no range."""
    every = tmp_path / "work"
    footage = open_footage(work.parent / "clip" / "clip.mp4", FrameRange(2, 20, 3))
    model = clip.truth(range(1, COUNT + 1))
    images = tuple(image for image in model.images if image.frame in footage.frames)
    keep_import(Imported(replace(model, images=images), "truth", ()), footage, every)
    out = tmp_path / "o" / "######.png"
    words = ("render", every, *LENS, "--out", out)
    done(*words, "--frames", "8-8")
    done(*words, "--jobs", 2)
    assert [int(path.stem) for path in sorted(out.parent.iterdir())] == [2, 5, 8, 11, 14, 17, 20]
    two = contents(out.parent)
    shutil.rmtree(out.parent)
    done(*words)
    assert contents(out.parent) == two


def test_what_a_process_warns_of_is_said(work: Path, tmp_path: Path) -> None:
    project = tmp_path / "project"
    clip.write_floats(project / "clip", 4)
    picture = cv2.imread(str(project / "clip" / "0003.tif"), cv2.IMREAD_UNCHANGED)
    picture[5, 7] = np.nan
    cv2.imwrite(str(project / "clip" / "0003.tif"), picture)
    mine = clip.solve(project / "clip", project / "work")
    said = done("render", mine, *LENS, "--out", tmp_path / "o" / "####.png", "--jobs", 2)
    assert said.count("1 pixels of 1 frames were not finite") == 1 and "filled in: 3" in said


def test_a_lens_with_everything_gives_the_same_frames_wherever_it_is_sent(tmp_path: Path) -> None:
    """To processes side by side, to a farm, and to a farm that solves first."""
    shot = clip.write_video(tmp_path / "clip", 6)
    mine, whole = clip.solve(shot, tmp_path / "work"), ("--for-movie", "--frames", "1-6")
    clip.write_masks(tmp_path / "masks", 6)
    clip.write_depth(tmp_path / "depth", 6)
    cv2.imwrite(str(tmp_path / "iris.png"), np.tri(32, dtype=np.uint8) * 255)
    lens = (
        "--focus-at", "0.3,0.5@2", "--focus-at", "0.7,0.4@5", "--blur", "0.06", "--tilt", "4",
        "--swing=-1e-05", "--quality", "draft", "--highlights", "2", "--highlight-threshold", "0.9",
        "--aperture", "ratio=1.5", "rotation=15", "swirl=0.4", "coma=0.2", "field_curvature=0.2",
        "anamorphic_focus=0.1", "lateral_colour=0.002", "matte_box_sides=0.4", "breathing=1",
        f"image={tmp_path / 'iris.png'}", "--seed", "3",
        "--mask", tmp_path / "masks", "--depth", tmp_path / "depth", "--borrow", "off",
    )  # fmt: skip
    done("render", mine, *lens, *whole, "--out", tmp_path / "one" / "####.png")
    done("render", mine, *lens, *whole, "--out", tmp_path / "jobs" / "####.png", "--jobs", 2)
    done("farm", mine, *lens, "--out", tmp_path / "job")
    done("farm", shot, *lens, "--out", tmp_path / "later")
    told = tmp_path / "later" / "input" / "lens.json"
    done("save", mine, "--lens", told, "--no-copy", "--frames", "1-6", "--blend", tmp_path / "later.blend")
    for name in ("masks", "depth"):
        shutil.rmtree(tmp_path / name)
    (tmp_path / "iris.png").unlink()
    for name, blend in (
        ("farm", tmp_path / "job" / "input" / "scene.blend"),
        ("solved", tmp_path / "later.blend"),
    ):
        done("render", blend, *whole, "--out", tmp_path / name / "####.png")
    one = contents(tmp_path / "one")
    assert len(one) == 6
    for name in ("jobs", "farm", "solved"):
        assert contents(tmp_path / name) == one, name


def test_a_blend_that_was_saved_is_rendered_with_its_lens(work: Path, tmp_path: Path) -> None:
    blend, out = tmp_path / "sent" / "a.blend", tmp_path / "o" / "######.png"
    done("save", work, *LENS, "--frames", "3-9", "--blend", blend)
    # What the file says of other things has no part in the frames.
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    assert (scene.frame_start, scene.frame_end) == (3, 9)
    scene.render.engine, scene.view_settings.view_transform = "BLENDER_EEVEE", "AgX"
    scene.view_settings.exposure, scene.render.use_border, scene.render.border_max_x = 2.0, True, 0.5
    bpy.ops.wm.save_mainfile()
    done("render", blend, "--frames", "3-4", "--out", out)
    reference = contents(work.parent / "frames")
    names = "000003.png", "000004.png"
    assert contents(out.parent) == {name: reference[name] for name in names}
    done("render", blend, "--frames", "1-48", "--out", tmp_path / "a.mp4", "--jobs", 2)
    assert_same(tmp_path / "a.mp4", work.parent / "one.mp4")


def test_a_blend_that_cannot_be_rendered_is_refused(work: Path, tmp_path: Path) -> None:
    blend, out = tmp_path / "a.blend", tmp_path / "o" / "####.png"
    done("save", work, *LENS, "--no-copy", "--blend", blend)
    empty, broken = tmp_path / "empty.blend", tmp_path / "broken.blend"
    broken.write_bytes(b"no blend")
    bpy.ops.wm.read_homefile(app_template="", use_empty=True, use_factory_startup=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(empty))
    for words, status, why in (
        (("render", blend, "--blur", "0.1", "--seed", "3"), 2, "leave out --blur, --seed"),
        (("render", work), 2, "one of --focus-at"),
        (("render", tmp_path / "none.blend"), 1, "none.blend is not there"),
        (("render", broken), 1, "broken.blend cannot be opened"),
        (("render", empty), 1, "no solved clip"),
        (("join", empty, "--rendered", tmp_path / "####.png"), 1, "no solved clip"),
    ):
        ended = here(*words, "--out", tmp_path / "a.mp4" if words[0] == "join" else out)
        assert ended.returncode == status and why in ended.stderr, ended.stderr
        assert ended.stderr.startswith("error: ") and ended.stderr.count("\n") == 1
        assert not out.parent.exists()
    packed = here("save", work, "--no-copy", "--pack", "--blend", tmp_path / "b.blend")
    assert packed.returncode == 2 and "--no-copy" in packed.stderr


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "cannot be read as JSON"),
        ('{"blurr": 1}', "blurr cannot be 1: there is no such option"),
        ('{"views": 5000}', "views cannot be 5000; give a number from 0 to 4096"),
        ('{"focus_distance": 7, "depth": null}', "depth cannot be None"),
        ('{"focus_distance": "six"}', "lens.json has a value of a wrong kind"),
    ],
)
def test_a_lens_of_a_job_that_was_edited_wrongly_is_refused(
    work: Path, tmp_path: Path, text: str, why: str
) -> None:
    file = tmp_path / "lens.json"
    file.write_text(text)
    ended = here("save", work, "--lens", file, "--no-copy", "--blend", tmp_path / "a.blend")
    assert ended.returncode == 1 and why in ended.stderr, ended.stderr
    assert ended.stderr.count("\n") == 1 and not (tmp_path / "a.blend").exists()


def children(process: int) -> list[int]:
    return [int(each) for each in Path(f"/proc/{process}/task/{process}/children").read_text().split()]


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are found in /proc")
@pytest.mark.parametrize("ended", ["child", "Ctrl-C", "SIGKILL"])
def test_jobs_that_are_ended(work: Path, tmp_path: Path, ended: str) -> None:
    out = tmp_path / "o" / "######.png"
    temporary = tmp_path / "tmp"
    process = start("render", work, *LENS, "--out", out, "--jobs", 2, temporary=temporary)
    while len(list(tmp_path.glob("o/0*.png"))) < 2:
        assert process.poll() is None
        time.sleep(0.01)
    running = children(process.pid)
    assert len(running) == 1
    if ended == "child":
        os.kill(running[0], signal.SIGKILL)
        said = "".join(process.communicate())
        assert process.returncode == 0, said
    else:
        number = {"Ctrl-C": signal.SIGINT, "SIGKILL": signal.SIGKILL}[ended]
        process.send_signal(number)
        process.communicate()
        assert process.returncode == {"Ctrl-C": 130, "SIGKILL": -9}[ended]
        until(lambda: not any(Path(f"/proc/{each}/cwd").exists() for each in running))
        done("render", work, *LENS, "--out", out)
    assert contents(out.parent) == contents(work.parent / "frames")
    if ended == "SIGKILL":
        # A child that was just starting may have cleared up already.
        headless("report", work, environment={"TMPDIR": str(temporary)})
    assert not list(temporary.glob("virtual-aperture-*"))


@pytest.mark.long
def test_frames_that_no_process_can_render_are_named(work: Path, tmp_path: Path) -> None:
    project = tmp_path / "project"
    shutil.copytree(work.parent / "clip", project / "clip")
    mine = clip.solve(project / "clip" / "clip.mp4", project / "work")
    masks = project / "masks"
    clip.write_masks(masks, COUNT)
    (masks / "0040.png").write_bytes(b"no picture")
    out = tmp_path / "o" / "####.png"
    words = ("render", mine, *LENS[:-4], "--views", 4, "--mask", masks, "--frames", "38-41")
    ended = here(*words, "--out", out, "--jobs", 2)
    said = ended.stdout + ended.stderr
    assert ended.returncode == 1 and "frames 40-41 could not be finished" in said and "0040.png" in said
    assert "wrote" not in said and "Traceback" not in said


def started(script: str) -> jobs.Start:
    """Has a process run a script, whose arguments are the frames of its share."""
    return lambda job, frames, _: job.start([sys.executable, "-c", script, *map(str, frames)])


def all_here(frames: Sequence[int], done: Callable[[int], None]) -> None:
    for frame in frames:
        done(frame)


def test_who_is_done_first_takes_frames_of_others() -> None:
    finished, drawn = list[int](), list[int]()

    def here(frames: Sequence[int], done: Callable[[int], None]) -> None:
        drawn.extend(frames)
        all_here(frames, done)
        if frames[-1] == 12:
            raise KeyboardInterrupt

    # The other process says nothing until it is ended: how fast it starts has no part.
    waits = started("import sys; sys.stdin.readline()")
    with pytest.raises(KeyboardInterrupt):
        jobs.render_side_by_side(range(20), 2, waits, here, finished.append, print)
    assert drawn == [*range(10), *range(19, 11, -1)]


def test_join_takes_only_frames_that_are_whole_and_of_one_lens(work: Path, tmp_path: Path) -> None:
    frames, out = tmp_path / "f", tmp_path / "a.mp4"
    shutil.copytree(work.parent / "frames", frames)
    words = ("join", work, "--rendered", frames / "######.png", "--out", out)
    done(*words, *LENS)
    assert_same(out, work.parent / "one.mp4")
    again = here(*words, *LENS)
    assert again.returncode == 1 and "exists" in again.stderr
    out.unlink()
    other = here(*words, *LENS[:3], "0.09", *LENS[4:])
    assert other.returncode == 1
    assert "1-48 was made from other inputs or with other settings" in other.stderr
    good = (frames / "000007.png").read_bytes()
    (frames / "000007.png").write_bytes(good[:-30])
    (frames / "000009.png").unlink()
    (frames / "000011.png").write_bytes(cv2.imencode(".png", np.zeros((54, 96, 3)))[1].tobytes())
    damaged = here(*words, *LENS)
    assert damaged.returncode == 1 and not out.exists()
    for message in (
        "frame 7 is cut off or damaged",
        "frame 9 is missing",
        "frame 11 was not rendered by this",
    ):
        assert message in damaged.stderr


OPEN = (
    "import sys; sys.path.insert(0, sys.argv[1]); import bpy, addon; addon.register();"
    "bpy.ops.wm.open_mainfile(filepath=sys.argv[2]); s = bpy.context.scene;"
    "s.frame_start, s.frame_end = int(sys.argv[3]), int(sys.argv[4]);"
    "bpy.ops.render.render(animation=True)"
)


@pytest.mark.long
@pytest.mark.parametrize("packed", [False, True])
def test_a_project_is_rendered_alike_in_two_other_places(work: Path, tmp_path: Path, packed: bool) -> None:
    home = tmp_path / "home"
    clip.write_masks(home / "my masks", COUNT)
    clip.write_depth(home / "my depth", COUNT)
    pictures = clip.write_pictures(home / "shot", COUNT)
    mine = clip.solve(pictures, home / "work")
    words = (*LENS[:-4], "--views", 4, "--mask", home / "my masks", "--depth", home / "my depth")
    done("render", mine, *words, "--frames", "5-6", "--out", tmp_path / "r" / "####.png")
    blend = tmp_path / "sent" / "a.blend"
    done("save", mine, *words, "--blend", blend, *(["--pack"] if packed else []))
    shutil.rmtree(home)
    places = tmp_path / "one place", tmp_path / "another"
    for place in places:
        if packed:
            with zipfile.ZipFile(blend.with_suffix(".zip")) as archive:
                archive.extractall(place)
                (found,) = place.iterdir()
                found.rename(place / "x")
        else:
            shutil.copytree(blend.parent, place / "x")
    shutil.rmtree(blend.parent)
    running = [
        subprocess.Popen([sys.executable, "-c", OPEN, str(ROOT), str(place / "x" / "a.blend"), "5", "6"],
                         stdout=subprocess.DEVNULL)
        for place in places
    ]  # fmt: skip
    assert [process.wait() for process in running] == [0, 0]
    one, two = (contents(place / "x" / "render") for place in places)
    assert one == two and list(one) == ["0005.png", "0006.png"]
    for name in one:
        a, b = (cv2.imread(str(path / name)) for path in (tmp_path / "r", places[0] / "x" / "render"))
        assert np.array_equal(a, b)


def test_a_blend_that_was_cut_off_is_not_kept(work: Path, tmp_path: Path) -> None:
    blend = tmp_path / "a" / "a.blend"
    done("save", work, *LENS, "--blend", blend)
    size = blend.stat().st_size
    blend.unlink()
    for share in (0.9, 0.99):
        words = [sys.executable, str(HEADLESS), "save", str(work), *LENS, "--blend", str(blend)]
        limited = subprocess.run(
            words, capture_output=True, text=True, check=False, preexec_fn=file_limit(int(share * size))
        )
        assert limited.returncode == 1 and "a.blend c" in limited.stderr, limited.stderr
        assert not blend.exists()


def test_a_job_that_solves_first(work: Path, tmp_path: Path) -> None:
    source = work.parent / "clip" / "clip.mp4"
    chunks = ("--solve-frames", "1-12", "--frames", "1-9", "--chunk", 4)
    done("farm", source, "--fov", 60, *LENS, *chunks, "--out", tmp_path / "job")
    job = json.loads((tmp_path / "job" / "template.json").read_text())
    steps = tasks(job, tmp_path / "job")
    assert {name: len(each) for name, each in steps.items()} == {
        "Solve": 1,
        "Scene": 1,
        "Render": 3,
        "Join": 1,
    }
    assert [step.get("dependencies") for step in job["steps"]] == [
        None, [{"dependsOn": "Solve"}], [{"dependsOn": "Scene"}], [{"dependsOn": "Render"}],
    ]  # fmt: skip
    words = " ".join(steps["Solve"][0])
    assert f"solve {tmp_path / 'job' / 'input' / 'clip.mp4'}" in words
    assert "--fov 60.0" in words and "--frames 1-12" in words
    assert [each[each.index("--frames") + 1] for each in steps["Render"]] == ["1-4", "5-8", "9-9"]
