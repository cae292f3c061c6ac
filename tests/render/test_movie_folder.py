"""Beside a movie nothing is removed or replaced but frames that this program wrote, as it wrote them."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.core.base.errors import UserError
from addon.render.output import frame_files, movie_folder, output

from ..faults import interrupted
from ..slanted_clip import FRAMES, listed, ready, rendered

__all__ = ["ready"]


def movie(scene: bpy.types.Scene, out: Path) -> list[str]:
    said: list[str] = []
    output.check_output(out, True)
    output.render_movie(scene, FRAMES, out, said.append)
    return said


def begun(scene: bpy.types.Scene, out: Path) -> Path:
    """A movie that was interrupted at its third frame; the folder of its frames."""
    with interrupted(3), pytest.raises(KeyboardInterrupt):
        movie(scene, out)
    return out.with_name(f"{out.name}.frames")


def chunks(png: bytes) -> list[bytes]:
    at, found = 8, []
    while at < len(png):
        end = at + 12 + int.from_bytes(png[at : at + 4])
        found.append(png[at:end])
        at = end
    return found


def edited(path: Path) -> None:
    """Turn a PNG's colours round; its notes stay, and it can be read."""
    picture, data = cv2.imread(str(path)), path.read_bytes()
    new = cv2.imencode(".png", cv2.bitwise_not(np.asarray(picture)))[1].tobytes()
    kept = [chunk for chunk in chunks(data) if chunk[4:8] not in (b"IDAT", b"IEND")]
    pixels = [chunk for chunk in chunks(new) if chunk[4:8] in (b"IDAT", b"IEND")]
    path.write_bytes(b"".join([data[:8], *kept, *pixels]))
    assert not frame_files.still_problem(path) and np.array_equal(cv2.imread(str(path)), 255 - picture)


@pytest.mark.parametrize("name", ["sub/notes.txt", "000002.png"])
def test_a_folder_of_the_users_is_refused_by_name(ready: bpy.types.Scene, tmp_path: Path, name: str) -> None:
    out = tmp_path / "out.mp4"
    theirs = tmp_path / "out.mp4.frames" / name
    theirs.parent.mkdir(parents=True)
    theirs.write_text("precious")
    with pytest.raises(UserError, match=f"{name.split('/')[0]} does not come from a run that makes out.mp4"):
        movie(ready, out)
    assert theirs.read_text() == "precious" and not out.exists()


def test_links_are_not_followed(ready: bpy.types.Scene, tmp_path: Path) -> None:
    out, theirs = tmp_path / "out.mp4", tmp_path / "theirs"
    begun(ready, tmp_path / "m" / "out.mp4").rename(theirs)
    before = listed(theirs)
    folder = tmp_path / "out.mp4.frames"
    for target in (theirs, tmp_path / "nothing", folder):
        folder.symlink_to(target)
        with pytest.raises(UserError, match="is a link, and the frames of"):
            movie(ready, out)
        folder.unlink()
    assert listed(theirs) == before
    folder = begun(ready, out)
    (tmp_path / "precious.png").write_bytes((folder / "000001.png").read_bytes())
    (folder / "000007.png").symlink_to(tmp_path / "precious.png")
    with pytest.raises(UserError, match=r"000007\.png does not come from a run"):
        movie(ready, out)
    assert (tmp_path / "precious.png").exists()


def test_a_file_in_its_place_is_refused(ready: bpy.types.Scene, tmp_path: Path) -> None:
    (tmp_path / "out.mp4.frames").write_text("precious")
    with pytest.raises(UserError, match=r"out\.mp4\.frames is a file, and the frames of out\.mp4"):
        movie(ready, tmp_path / "out.mp4")
    assert (tmp_path / "out.mp4.frames").read_text() == "precious"


def test_a_run_goes_on_and_takes_away_what_is_its_own(ready: bpy.types.Scene, tmp_path: Path) -> None:
    out = tmp_path / "out.mp4"
    folder = begun(ready, out)
    assert [path.name for path in sorted(folder.iterdir())] == [movie_folder.MARK, "000001.png", "000002.png"]
    # Of a longer run of before, cut off by a power cut, and of a file manager.
    (folder / "000009.png").write_bytes((folder / "000001.png").read_bytes())
    (folder / "000010.png").touch()
    (folder / ".DS_Store").touch()
    assert "2 frames there already" in movie(ready, out)
    assert not folder.exists() and out.exists()


def test_what_is_put_there_meanwhile_stays(ready: bpy.types.Scene, tmp_path: Path) -> None:
    out, folder = tmp_path / "out.mp4", tmp_path / "out.mp4.frames"

    def put(line: str) -> None:
        if line.startswith("frame 3"):
            (folder / "notes.txt").write_text("precious")
        said.append(line)

    said: list[str] = []
    output.render_movie(ready, FRAMES, out, put)
    assert out.exists() and f"{folder} stays: notes.txt in it was not made by this run" in said[-1]
    assert [path.name for path in sorted(folder.iterdir())] == [movie_folder.MARK, "notes.txt"]
    with pytest.raises(UserError, match=r"notes\.txt does not come from a run"):
        movie(ready, out)


def test_an_edited_frame_is_not_taken_for_ours(ready: bpy.types.Scene, tmp_path: Path) -> None:
    out = tmp_path / "o" / "####.png"
    rendered(ready, out)
    first, frame = listed(out.parent), out.with_name("0002.png")
    edited(frame)
    theirs = frame.read_bytes()
    with pytest.raises(UserError, match=r"0002\.png already exists and was changed after it was rendered"):
        rendered(ready, out)
    with pytest.raises(UserError, match="frame 2 was changed after it was rendered"):
        output.check_frames({frame: out.with_name(f"000{frame}.png") for frame in FRAMES}, (160, 90))
    assert frame.read_bytes() == theirs
    rendered(ready, out, overwrite=True)
    assert listed(out.parent) == first


def test_an_edited_frame_stops_the_movie_it_is_kept_for(ready: bpy.types.Scene, tmp_path: Path) -> None:
    out = tmp_path / "out.mp4"
    folder = begun(ready, out)
    edited(folder / "000002.png")
    theirs = (folder / "000002.png").read_bytes()
    with pytest.raises(UserError, match=r"000002\.png was changed after it was rendered; move it away"):
        movie(ready, out)
    assert (folder / "000002.png").read_bytes() == theirs and not out.exists()
    (folder / "000002.png").unlink()
    movie(ready, out)


@pytest.mark.parametrize("suffix", [".png", ".exr"])
def test_a_key_covers_every_byte(ready: bpy.types.Scene, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / "o" / f"####{suffix}"
    rendered(ready, out)
    path = out.with_name(f"0001{suffix}")
    data = path.read_bytes()
    assert not frame_files.is_changed(path) and not frame_files.still_problem(path)
    # In the pixels, and behind them.
    for at in (len(data) // 2, len(data) - 5, len(data)):
        path.write_bytes(data[:at] + b"\x01\x02\x03" + data[at + 3 :])
        assert frame_files.is_changed(path)
    path.write_bytes(data)
    os.utime(path, (0, 0))
    assert not frame_files.is_changed(path)
