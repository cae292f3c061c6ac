"""The video of the store's page shows each step of the work, and is as long as the platform asks for."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from sample_scenes import store_video
from sample_scenes.demo import DemoError
from sample_scenes.store_video import HEIGHT, RATE, STEPS, WIDTH


def screens(folder: Path) -> Path:
    for number, name in enumerate((*(name for name, *_ in STEPS), "scrub_01", "scrub_04")):
        cv2.imwrite(str(folder / f"{name}.png"), np.full((1000, 1600, 3), 20 * number, np.uint8))
    return folder


def test_it_shows_all_steps_in_20_seconds(tmp_path: Path) -> None:
    clip = np.full((36, 36, 64, 3), 200, np.uint8)
    parts = store_video.scenes(screens(tmp_path), clip, clip)
    shown = [list(part.frames()) for part in parts]
    assert [picture[0, 0, 0] for picture in (each[0] for each in shown[:7])] == [0, 20, 40, 60, 80, 100, 120]
    assert {picture.shape for each in shown for picture in each} == {(HEIGHT, WIDTH - store_video.COLUMN, 3)}
    assert 18 <= sum(map(len, shown)) / RATE <= 22
    (tmp_path / "pick.png").unlink()
    with pytest.raises(DemoError, match=r"pick\.png is missing"):
        store_video.scenes(tmp_path, clip, clip)


def test_it_keeps_colours(tmp_path: Path) -> None:
    colour = (40, 90, 200)
    out = tmp_path / "video.mp4"
    store_video.write_video(out, iter([np.full((HEIGHT, WIDTH, 3), colour, np.uint8)] * 3))
    with av.open(str(out)) as film:
        frames = [frame.to_ndarray(format="bgr24") for frame in film.decode(video=0)]
        assert film.streams.video[0].codec_context.name == "h264"
    assert len(frames) == 3 and np.abs(frames[0].astype(int) - colour).max() <= 3
