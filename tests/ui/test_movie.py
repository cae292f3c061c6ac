"""Render Clip as a movie: with the clip's rate and sound, and nothing of the scene or the disk touched."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import bpy
import numpy as np
import pytest

from addon.core.base.worker import tend
from addon.core.media.clip import open_footage
from addon.render.output.output import crop_to_even
from addon.render.views.frame_size import written_size
from addon.scene.build import build
from addon.ui.jobs import movie
from benchmarks.torture import clip as solved

from ..recorder import Recorder
from ..waiting import until

COUNT = 6
SLOW = 128
"""Views of a frame that takes so long that the movie still renders when it is ended."""


@pytest.fixture
def clip(scene: bpy.types.Scene, tmp_path: Path) -> Iterator[Path]:
    """A clip with sound, solved and in focus in the scene."""
    path = solved.write_video(tmp_path, COUNT)
    settings = build(scene, open_footage(path), solved.truth(range(1, COUNT + 1)))
    settings.focus_distance, settings.views = 8.0, 4
    settings.blur = 0.03
    yield path
    movie.MovieJob.stop()


def render_clip(**options: bool) -> set[str]:
    return set(bpy.ops.virtual_aperture.render_clip(**options))


def set_values(of: bpy.types.bpy_struct) -> dict[str, Any]:
    """Everything that can be set in render settings, and in what lies in them."""
    found: dict[str, Any] = {}
    for each in of.bl_rna.properties:
        value = getattr(of, each.identifier)
        if each.type == "POINTER":
            if each.identifier in ("image_settings", "ffmpeg", "bake"):
                found[each.identifier] = set_values(value)
        elif each.type != "COLLECTION" and not each.is_readonly:
            found[each.identifier] = list(value) if getattr(each, "is_array", False) else value
    return found


def shown() -> Recorder:
    """How far the movie is, as panels draw it."""
    layout = Recorder()
    movie.draw(layout)  # type: ignore[arg-type]
    return layout


def files(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*")}


def means(path: Path) -> list[float]:
    with av.open(str(path)) as held:
        return [float(frame.to_ndarray(format="rgb24").mean()) for frame in held.decode(video=0)]


def test_a_movie_has_the_clips_rate_and_sound_and_leaves_all_else(
    scene: bpy.types.Scene, clip: Path, tmp_path: Path
) -> None:
    scene.render.engine = "CYCLES"
    scene.render.image_settings.file_format = "OPEN_EXR"
    before, others = set_values(scene.render), files(tmp_path)
    assert render_clip() == {"FINISHED"}
    out = tmp_path / "clip_render.mp4"
    assert files(tmp_path) == others | {out.name}
    assert set_values(scene.render) == before and [each.name for each in bpy.data.scenes] == ["Scene"]
    with av.open(str(out)) as made, av.open(str(clip)) as source:
        picture, heard = made.streams.video[0], made.streams.audio[0]
        assert (picture.codec_context.name, picture.frames) == ("h264", COUNT)
        assert picture.average_rate == source.streams.video[0].average_rate == solved.RATE
        loudest = (
            max(np.abs(part.to_ndarray()).max() for part in held.decode(audio=0)) for held in (made, source)
        )
        assert next(loudest) == pytest.approx(next(loudest), rel=0.1)
        assert heard.duration * heard.time_base == pytest.approx(COUNT / solved.RATE, abs=0.05)
    assert shown().texts == [out.name]
    scene.virtual_aperture.footage = ""
    assert shown().texts == []


def test_a_movie_that_is_there_is_replaced_only_where_that_is_said(
    scene: bpy.types.Scene, clip: Path, tmp_path: Path
) -> None:
    out = tmp_path / "clip_render.mp4"
    out.write_bytes(b"precious")
    with pytest.raises(RuntimeError, match=r"clip_render\.mp4 already exists"):
        render_clip()
    assert out.read_bytes() == b"precious"
    scene.frame_end = 2
    assert render_clip(overwrite=True) == {"FINISHED"}
    assert len(means(out)) == 2


@pytest.mark.long
def test_the_compositor_and_the_border_have_their_part(
    scene: bpy.types.Scene, clip: Path, tmp_path: Path
) -> None:
    scene.frame_end = 2
    scene.render.filepath = str(tmp_path / "plain.mp4")
    assert render_clip() == {"FINISHED"}
    tree = bpy.data.node_groups.new("Dark", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    layers, darker = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeExposure")
    darker.inputs["Exposure"].default_value = -2.0
    tree.links.new(layers.outputs["Image"], darker.inputs["Image"])
    tree.links.new(darker.outputs["Image"], tree.nodes.new("NodeGroupOutput").inputs["Image"])
    scene.compositing_node_group = tree
    render = scene.render
    render.use_border = render.use_crop_to_border = True
    # 47 pixels across, which H.264 does not take.
    render.border_max_x = 47 / solved.LENS.width
    for name in ("dark", "again"):
        render.filepath = str(tmp_path / f"{name}.mp4")
        assert render_clip() == {"FINISHED"}
    with av.open(str(tmp_path / "dark.mp4")) as made:
        assert (made.streams.video[0].width, made.streams.video[0].height) == (46, solved.LENS.height)
    plain, dark = (np.mean(means(tmp_path / f"{name}.mp4")) for name in ("plain", "dark"))
    # Two stops of linear light are a factor of 4 ** (1 / 2.4) in sRGB's upper part.
    assert dark < 0.7 * plain
    assert means(tmp_path / "again.mp4") == means(tmp_path / "dark.mp4")


def test_nothing_stays_of_a_movie_that_is_cancelled(
    scene: bpy.types.Scene, clip: Path, tmp_path: Path
) -> None:
    with pytest.raises(RuntimeError, match="No movie is being rendered"):
        bpy.ops.virtual_aperture.cancel_movie()
    before = files(tmp_path)
    scene.render.filepath = str(tmp_path / "new" / "film.mp4")
    scene.virtual_aperture.views = SLOW
    made = movie.begin(scene, movie.movie_path(scene), False)
    until(lambda: made.poll() and made.done > 0)
    assert f"Movie: {made.done} of {COUNT} frames" in shown().texts[0]
    assert shown().operators == ["virtual_aperture.cancel_movie"]
    with pytest.raises(RuntimeError, match="A movie is being rendered"):
        render_clip()
    assert (made.out.parent / "film.mp4.frames").is_dir()
    assert bpy.ops.virtual_aperture.cancel_movie() == {"FINISHED"}
    until(lambda: tend() or not made.out.parent.exists())
    assert files(tmp_path) == before and shown().texts == []


@pytest.mark.long
def test_the_next_press_goes_on_after_blender_was_closed(
    scene: bpy.types.Scene, clip: Path, tmp_path: Path
) -> None:
    before = files(tmp_path)
    scene.virtual_aperture.views = SLOW
    made = movie.begin(scene, movie.movie_path(scene), False)
    until(lambda: made.poll() and made.done > 0)
    assert made.process is not None
    # As it does where the one that started it is gone.
    made.process.terminate()
    until(lambda: made.poll() == [] and not made.is_running)
    assert made.failure is not None and not made.out.exists()
    again = movie.begin(scene, movie.movie_path(scene), False)
    until(lambda: again.poll() and again.done > 0)
    assert again.total == COUNT - made.done
    until(lambda: again.poll() == [] and not again.is_running)
    assert again.failure is None
    assert files(tmp_path) == before | {"clip_render.mp4"} and len(means(again.out)) == COUNT


def test_where_a_movie_is_written(scene: bpy.types.Scene, clip: Path, tmp_path: Path) -> None:
    folder = tmp_path.as_posix()
    for output, expected in {
        scene.render.filepath: "clip_render.mp4",
        f"{folder}/": "clip_render.mp4",
        f"{folder}/films/": "films/clip_render.mp4",
        f"{folder}/films/####": "films/clip_render.mp4",
        f"{folder}/films/shot.v2_####.png": "films/shot.v2.mp4",
        f"{folder}/films/shot": "films/shot.mp4",
        f"{folder}/films/shot.MOV": "films/shot.MOV",
        f"{folder}/{{blend_name}}/a_{{camera_name}}": "Unsaved/clip_render.mp4",
    }.items():
        scene.render.filepath = output
        assert movie.movie_path(scene) == tmp_path / expected
    scene.render.filepath = f"{folder}/films/"
    scene.virtual_aperture.footage = f"{folder}/shot_####.png"
    assert movie.movie_path(scene) == tmp_path / "films/shot_render.mp4"


def test_odd_sizes_lose_a_row_or_column(scene: bpy.types.Scene) -> None:
    render = scene.render
    for left, right, wide, high in [(0, 45, 101, 51), (7, 52, 100, 50), (8, 51, 101, 50)]:
        render.resolution_x, render.resolution_y = wide, high
        render.use_border = render.use_crop_to_border = True
        render.border_min_x, render.border_max_x = left / wide, right / wide
        render.border_min_y, render.border_max_y = 0.0, 1.0
        crop_to_even(render)
        assert written_size(render) == ((right - left) // 2 * 2, high // 2 * 2)
        render.use_border = False
        crop_to_even(render)
        assert written_size(render) == (wide // 2 * 2, high // 2 * 2)
