"""The animations of the README go on without a jump, and are light."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from sample_scenes import moving_picture
from sample_scenes.demo import DemoError

ROOT = Path(__file__).resolve().parents[2]


def test_to_and_fro_begins_again_where_it_ends() -> None:
    frames = np.arange(4, dtype=np.uint8)[:, None, None, None]
    played, durations = moving_picture.to_and_fro(frames)
    assert played.ravel().tolist() == [0, 1, 2, 3, 2, 1]
    rest, short = moving_picture.REST, moving_picture.DURATION
    assert durations == [rest, short, short, rest, short, short]


def test_an_animation_is_as_good_as_its_size_allows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    noise = np.random.default_rng(1).integers(0, 255, (3, 60, 80, 3), np.uint8)
    out = tmp_path / "noise.webp"
    best = moving_picture.write_webp(out, noise, [50, 60, 70])
    found, animation = cv2.imreadanimation(str(out))
    assert found and len(animation.frames) == 3 and list(animation.durations) == [50, 60, 70]
    monkeypatch.setattr(moving_picture, "HEAVIEST", out.stat().st_size * 3 // 4)
    assert moving_picture.write_webp(out, noise, [50, 60, 70]) < best
    assert out.stat().st_size <= moving_picture.HEAVIEST
    monkeypatch.setattr(moving_picture, "HEAVIEST", 100)
    with pytest.raises(DemoError, match="3 frames make more than 100 bytes"):
        moving_picture.write_webp(out, noise, [50, 60, 70])


def test_the_window_at_work_takes_all_its_screenshots(tmp_path: Path) -> None:
    with pytest.raises(DemoError, match="no screenshots of a pull"):
        moving_picture.at_work(tmp_path)
    for name in (*moving_picture.STEPS, "scrub_01", "scrub_04", "scrub_07"):
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.full((1000, 1600, 3), 90, np.uint8))
    frames, durations = moving_picture.at_work(tmp_path)
    assert len(frames) == len(durations) == len(moving_picture.STEPS) + 4
    assert {frame.shape for frame in frames} == {(834, moving_picture.WIDTH, 3)}
    (tmp_path / "pick.png").unlink()
    with pytest.raises(DemoError, match=r"pick\.png is missing"):
        moving_picture.at_work(tmp_path)


def test_those_of_the_readme_move_and_are_light() -> None:
    for name in ("focus_pull.webp", "at_work.webp"):
        file = ROOT / "docs" / name
        found, animation = cv2.imreadanimation(str(file))
        assert found and len(animation.frames) > 10 and animation.loop_count == 0
        assert file.stat().st_size <= moving_picture.HEAVIEST
