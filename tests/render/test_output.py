"""Output that is called written is whole and right, whatever happens meanwhile."""

from __future__ import annotations

from pathlib import Path

import bpy
import cv2
import pytest

from addon.core.base import atomic
from addon.core.base.errors import UserError
from addon.render import engine
from addon.render.output import frame_files, output
from addon.render.output.frame_files import frame_keys
from addon.scene.sources import shot

from ..faults import full_disk, interrupted
from ..movies import assert_same
from ..slanted_clip import FRAMES, listed, ready, rendered

__all__ = ["ready"]


def test_frames_are_kept_by_their_own_key_and_replaced_only_when_asked(
    ready: bpy.types.Scene, tmp_path: Path
) -> None:
    out = tmp_path / "o" / "####.png"
    rendered(ready, out)
    first = listed(out.parent)
    assert "3 frames there already" in rendered(ready, out)
    ready.virtual_aperture.blur = 0.08
    with pytest.raises(UserError, match="made from other inputs or with other settings"):
        rendered(ready, out)
    assert listed(out.parent) == first
    # Interrupted while it overwrites: the frames that were replaced are the new ones, and a third run knows.
    with interrupted(3), pytest.raises(KeyboardInterrupt):
        rendered(ready, out, overwrite=True)
    mixed = listed(out.parent)
    assert mixed["0003.png"] == first["0003.png"] and mixed["0001.png"] != first["0001.png"]
    assert "2 frames there already" in rendered(ready, out, overwrite=True)
    whole = tmp_path / "whole" / "####.png"
    rendered(ready, whole)
    assert listed(whole.parent) == listed(out.parent)


def test_a_full_disk_is_an_error_and_leaves_nothing(ready: bpy.types.Scene, tmp_path: Path) -> None:
    suffix = ".png"
    out = tmp_path / "o" / f"####{suffix}"
    rendered(ready, out)
    size = min(len(data) for data in listed(out.parent).values())
    (out.parent / f"0002{suffix}").unlink()
    for limit in (size // 2, 1000, 0):
        with full_disk(limit), pytest.raises(UserError):
            rendered(ready, out)
        assert list(listed(out.parent)) == [f"0001{suffix}", f"0003{suffix}"]
    assert "2 frames there already" in rendered(ready, out)


def test_damaged_and_empty_frames_are_rendered_again(ready: bpy.types.Scene, tmp_path: Path) -> None:
    out = tmp_path / "o" / "####.png"
    rendered(ready, out)
    good = listed(out.parent)
    (out.parent / "0001.png").write_bytes(good["0001.png"][:-200])
    (out.parent / "0002.png").write_bytes(b"")
    # One bit that the decoder does not mind: only the checksum tells.
    data = bytearray(good["0003.png"])
    data[-2] ^= 1
    (out.parent / "0003.png").write_bytes(bytes(data))
    said = rendered(ready, out)
    assert "3 frames there but damaged or empty: rendered again" in said
    assert listed(out.parent) == good


def test_a_repainted_clip_gives_other_keys(ready: bpy.types.Scene, tmp_path: Path) -> None:
    out = tmp_path / "o" / "####.png"
    rendered(ready, out)
    path = tmp_path / "clip" / "clip_0002.png"
    picture = cv2.imread(str(path))
    picture[10:20, 10:20] = 255 - picture[10:20, 10:20]
    cv2.imwrite(str(path), picture)
    shot.forget()
    with pytest.raises(UserError, match="is not the clip that was solved"):
        rendered(ready, out)


def test_movies_are_whole_or_not_there(ready: bpy.types.Scene, tmp_path: Path) -> None:
    out = tmp_path / "{m} #2.mp4"
    output.render_movie(ready, FRAMES, out, lambda text: None)
    first = out.read_bytes()
    assert not frame_files.movie_problem(out, 3, (160, 90))
    whole = tmp_path / "clip" / "whole.mp4"
    out.rename(whole)
    said: list[str] = []
    with interrupted(3), pytest.raises(KeyboardInterrupt):
        output.render_movie(ready, FRAMES, out, said.append)
    assert not out.exists()
    output.render_movie(ready, FRAMES, out, said.append)
    assert "2 frames there already" in said
    assert_same(out, whole)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["clip", out.name]
    out.unlink()
    # The last bytes are behind all frames.
    for size in (len(first) // 2, len(first) - 1):
        with full_disk(size), pytest.raises(UserError):
            output.render_movie(ready, FRAMES, out, said.append)
        assert not out.exists()


@pytest.mark.parametrize("suffix", output.MOVIES)
def test_a_movie_without_its_last_bytes_is_told(ready: bpy.types.Scene, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"a{suffix}"
    output.render_movie(ready, FRAMES, out, lambda text: None)
    whole = out.read_bytes()
    assert not frame_files.movie_problem(out, 3, (160, 90))
    for lost in (1, 23):
        out.write_bytes(whole[:-lost])
        assert frame_files.movie_problem(out, 3, (160, 90))
    out.write_bytes(whole + b"1")
    assert frame_files.movie_problem(out, 3, (160, 90)) == "is cut off"


def test_unfinished_files_of_dead_processes_are_collected(tmp_path: Path) -> None:
    names = "0123456789ab-0123abcd", "0123456789ab-7-0123abcd"
    dead = [tmp_path / f".part-{name}{end}" for end in ("-a.png", ".lock") for name in names]
    mine, unknown = tmp_path / ".part-mine.png", tmp_path / ".part-0123456789ab-89abcdef-a.png"
    for path in (*dead, mine, unknown):
        path.touch()
    with atomic.owned(tmp_path, atomic.PART) as name:
        alive = [tmp_path / f"{name}-a.png", tmp_path / f"{name}.lock"]
        alive[0].touch()
        assert sorted(atomic.collect_orphans(tmp_path)) == sorted(dead)
        assert sorted(tmp_path.iterdir()) == sorted([mine, unknown, *alive])


def test_what_fails_while_writing_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    atomic.write_bytes(path, b"old")
    with pytest.raises(ZeroDivisionError), atomic.staged(path) as part:
        part.write_bytes(b"new")
        raise ZeroDivisionError
    assert listed(tmp_path) == {"a.txt": b"old"}
    with pytest.raises(UserError, match=r"a\.txt/b cannot be written"):
        atomic.write_bytes(path / "b", b"")


def test_a_keyed_lens_is_in_the_key_of_each_frame(ready: bpy.types.Scene) -> None:
    settings, keys = ready.virtual_aperture, []
    for last in (7.0, 9.0):
        for frame, distance in ((1, 6.0), (3, last)):
            settings.focus_distance = distance
            ready.keyframe_insert("virtual_aperture.focus_distance", frame=frame)
        ready.frame_set(1)
        keys.append(frame_keys(ready, FRAMES))
    assert keys[0][1] == keys[1][1]
    assert keys[0][2] != keys[1][2] and keys[0][3] != keys[1][3]


def test_a_frame_that_was_never_begun_is_not_taken_for_one(ready: bpy.types.Scene, tmp_path: Path) -> None:
    """As where a signal arrives while Blender prepares a frame: then its picture is black, and no error."""
    out = tmp_path / "o" / "####.png"
    render = engine.VirtualApertureEngine.render
    engine.VirtualApertureEngine.render = lambda self, depsgraph: None
    try:
        with pytest.raises(UserError, match="before there was a picture"):
            rendered(ready, out)
    finally:
        engine.VirtualApertureEngine.render = render
    assert not listed(out.parent)
    rendered(ready, out)
    assert len(listed(out.parent)) == 3
