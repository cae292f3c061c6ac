"""Clips that hold more light than white: what is rendered of them, and the movies that they become."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.core.media.clip import open_footage
from addon.core.media.picture_file import read_picture
from addon.scene.sources import colour_space

from ..media.colour_curves import HLG, LOGS, PQ, Array, Recorded, write_clip
from ..scenes import psnr
from .solved_clips import BRIGHT, SHOWN, filmed, imported, run

LUMA = np.array([0.2627, 0.6780, 0.0593])


def write_exr(folder: Path, pictures: list[Array]) -> Path:
    """The same as files of a sequence."""
    folder.mkdir()
    height, width = pictures[0].shape[:2]
    for number, light in enumerate(pictures, 1):
        image = bpy.data.images.new("frame", width, height, float_buffer=True)
        rgba = np.dstack([light, np.ones((height, width))])[::-1].astype(np.float32)
        image.pixels.foreach_set(np.ascontiguousarray(rgba).ravel())  # type: ignore[arg-type]
        image.file_format, image.filepath_raw = "OPEN_EXR", str(folder / f"clip_{number:04d}.exr")
        image.save()
        bpy.data.images.remove(image)
    return folder


def rendered(work: Path, out: Path, *options: object) -> Array:
    """A frame in linear light."""
    assert run("render", work, *BRIGHT, *options, "--frames", SHOWN, "--out", out / "####.exr") == 0
    return read_picture(out / f"{SHOWN:04d}.exr")[..., :3].astype(float)


@pytest.mark.long
@pytest.mark.parametrize("space", [HLG, PQ, *LOGS], ids=lambda space: space.name)
def test_it_is_rendered_as_its_light_is(registered: None, tmp_path: Path, space: Recorded) -> None:
    """As the same light in EXR files, and its movie is in the clip's own range, 10 bits deep."""
    for name in ("exr", "clip"):
        (tmp_path / name).mkdir()
    pictures = filmed(tmp_path / "plane")
    whole = imported(tmp_path / "exr", write_exr(tmp_path / "exr" / "frames", pictures))
    truth = rendered(whole, tmp_path / "a")
    write_clip(tmp_path / "clip.mov", pictures, space)
    work = imported(tmp_path / "clip", tmp_path / "clip.mov")
    said = ["--colour-space", space.name] if space in LOGS else []
    found = rendered(work, tmp_path / "b", *said)
    assert truth.max() > 2
    score = psnr(space.stored(found), space.stored(truth))
    print(f"{space.name}: {score:.2f} dB of its signal from EXR in, EXR out")
    assert score > 40
    movie = tmp_path / "out.mp4"
    assert run("render", work, *BRIGHT, *said, "--frames", "2-4", "--out", movie) == 0
    clip = open_footage(movie)
    stored = clip.read(SHOWN - 1)
    assert stored.dtype == np.uint16
    assert clip.colour_space == ("" if space in LOGS else space.name)
    # Colour is stored for two by two pixels, so brightness is compared; of a log's movie, which is made for
    # an ordinary display, that up to white.
    light = colour_space.colour_space(clip.colour_space or "sRGB").to_light(stored)
    shown = HLG if space in LOGS else space
    lumas = [
        shown.stored(np.minimum(each, 1.0 if space in LOGS else np.inf)) @ LUMA for each in (light, found)
    ]
    score = psnr(*lumas)
    print(f"{space.name}: its movie {score:.2f} dB")
    assert score > 40


def test_colors_outside_of_rec_709_stay(registered: None, tmp_path: Path) -> None:
    """A green that only Rec.2020 has is below zero in Rec.709's red, and in the rendered frame, too."""
    green = [0.3 * np.array([-0.5876, 1.1329, -0.1006]) * np.ones((90, 160, 1))] * 6
    write_clip(tmp_path / "clip.mov", green, HLG)
    found = rendered(imported(tmp_path, tmp_path / "clip.mov"), tmp_path / "out")
    np.testing.assert_allclose(found[20:70, 30:130], green[0][20:70, 30:130], atol=0.01)
