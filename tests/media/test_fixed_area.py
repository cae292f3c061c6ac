"""What is burnt into a clip, in coded clips that are generated here: found to a pixel, and never guessed."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from addon.core.media.clip import open_footage
from addon.core.media.fixed_area import FixedArea, fixed_area

from ..scenes import texture
from ..variants import combined

SIZE = (320, 180)
COUNT = 24
BLACK = (0, 0, 0)


def moving(gain: float = 1.0, step: int = 5, seed: int = 0) -> list[np.ndarray]:
    """Frames (h, w, 3) of a camera that goes by, with a sensor's noise."""
    width, height = SIZE
    wide = texture(width + step * COUNT, height + 40, seed)
    noise = np.random.default_rng(seed)
    found = []
    for number in range(COUNT):
        down = int(20 + 15 * np.sin(number / 3))
        seen = wide[down : down + height, step * number : step * number + width]
        found.append(np.clip(gain * seen + noise.normal(0, 2, seen.shape), 0, 255).astype(np.uint8))
    return found


def barred(
    frames: list[np.ndarray], top: int, bottom: int, left: int, right: int, colour: tuple[int, ...] = BLACK
) -> list[np.ndarray]:
    inside = np.s_[top : SIZE[1] - bottom, left : SIZE[0] - right]
    found = [np.full_like(frame, colour) for frame in frames]
    for one, frame in zip(found, frames, strict=True):
        one[inside] = frame[inside]
    return found


def timed(frames: list[np.ndarray], opaque: bool) -> tuple[list[np.ndarray], np.ndarray]:
    """Frames with a timecode, and the pixels that it changed in any."""
    found = []
    for number, frame in enumerate(frames):
        text, made = f"00:00:{number // 12:02d}:{number % 12:02d}", frame.copy()
        (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.6, 1)
        if opaque:
            cv2.rectangle(made, (15, 158 - height - 5), (25 + width, 158 + below), BLACK, -1)
        around = [(x, y, BLACK) for x in (-2, 0, 2) for y in (-2, 0, 2)]
        for x, y, colour in (*around, (0, 0, (255, 255, 255))):
            cv2.putText(made, text, (20 + x, 158 + y), cv2.FONT_HERSHEY_SIMPLEX, 0.6, colour, 2, cv2.LINE_AA)
        found.append(made)
    return found, np.any([a != b for a, b in zip(found, frames, strict=True)], axis=(0, 3))


def branded(frames: list[np.ndarray], alpha: float = 1.0) -> list[np.ndarray]:
    found = []
    for frame in frames:
        made = frame.copy()
        cv2.circle(made, (280, 32), 18, (220, 30, 40), -1, cv2.LINE_AA)
        cv2.putText(made, "TV", (267, 39), cv2.FONT_HERSHEY_DUPLEX, 0.7, (255, 255, 255), 2, cv2.LINE_AA)
        found.append(np.uint8(alpha * made + (1 - alpha) * frame))
    return found


def found_in(frames: list[np.ndarray], path: Path, crf: int = 23) -> FixedArea | None:
    """The fixed area of frames that are coded as H.264."""
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", rate=24, options={"crf": str(crf), "preset": "fast"})
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        for frame in frames:
            file.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        file.mux(stream.encode())
    footage = open_footage(path)
    try:
        return fixed_area(footage.read, footage.frames)
    finally:
        footage.close()


SIDES = [(22, 22, 0, 0), (17, 31, 0, 0), (0, 0, 40, 40), (12, 20, 30, 26), (0, 27, 0, 0), (0, 0, 33, 0)]
"""Widths of bars at the top, the bottom, the left and the right."""
BARS = [
    (BLACK, 1.0, 18), (BLACK, 0.35, 28), ((16, 16, 16), 1.0, 28), ((40, 40, 40), 1.0, 23),
    ((255, 255, 255), 0.35, 28), ((160, 40, 90), 1.0, 18),
]  # fmt: skip
"""Their colour, the brightness of the picture between them, and x264's quality."""


@pytest.mark.parametrize(("sides", "bars"), combined(SIDES, BARS))
def test_bars_are_found_to_a_pixel(
    sides: tuple[int, int, int, int], bars: tuple[tuple[int, ...], float, int], tmp_path: Path
) -> None:
    colour, gain, crf = bars
    found = found_in(barred(moving(gain), *sides, colour), tmp_path / "clip.mp4", crf)
    assert found is not None
    top, bottom, left, right = sides
    true = np.ones(SIZE[::-1], bool)
    true[top : SIZE[1] - bottom, left : SIZE[0] - right] = False
    # Coding moves an edge of colour by a pixel.
    least, most = (change(true.astype(np.uint8), np.ones((3, 3))) > 0 for change in (cv2.erode, cv2.dilate))
    assert np.all(found.mask[least]) and not np.any(found.mask[~most])


@pytest.mark.parametrize(("opaque", "crf"), [(True, 28), (False, 18)])
def test_a_timecode_is_found_with_its_changing_digits(opaque: bool, crf: int, tmp_path: Path) -> None:
    frames, true = timed(moving(), opaque)
    found = found_in(frames, tmp_path / "clip.mp4", crf)
    assert found is not None
    assert np.mean(found.mask[true]) > 0.97
    # Not much more than its box.
    x, y, across, down = cv2.boundingRect(true.astype(np.uint8))
    assert found.mask[y - 4 : y + down + 4, x - 12 : x + across + 12].sum() == found.mask.sum()


def test_a_logo_is_found(tmp_path: Path) -> None:
    plain = moving()
    frames = branded(plain)
    true = np.any([a != b for a, b in zip(frames, plain, strict=True)], axis=(0, 3))
    found = found_in(frames, tmp_path / "clip.mp4", 28)
    assert found is not None
    assert np.mean(found.mask[true]) > 0.9
    assert np.mean(found.mask[cv2.dilate(true.astype(np.uint8), np.ones((9, 9))) == 0]) == 0


def still() -> list[np.ndarray]:
    noise = np.random.default_rng(5)
    first = moving()[0]
    return [np.clip(first + noise.normal(0, 2, first.shape), 0, 255).astype(np.uint8) for _ in range(COUNT)]


def vignetted() -> list[np.ndarray]:
    x, y = np.meshgrid(np.linspace(-1, 1, SIZE[0]), np.linspace(-1, 1, SIZE[1]))
    light = np.clip(1.6 - 1.6 * np.hypot(x, y), 0, 1)[..., None]
    return [np.uint8(light * frame) for frame in moving()]


def hooded() -> list[np.ndarray]:
    """A dark hood out of focus at the upper border, in which there is noise."""
    light = np.clip((np.arange(SIZE[1]) - 20) / 25, 0.04, 1)[:, None, None]
    return [np.uint8(light * frame) for frame in moving()]


def shirt() -> list[np.ndarray]:
    """Something black, with an outline that is not straight, at the lower border."""
    found = moving()
    for number, frame in enumerate(found):
        cv2.ellipse(frame, (160 + number % 3, 190), (170, 60), 0, 0, 360, (4, 4, 5), -1, cv2.LINE_AA)
    return found


NOTHING = {
    "moving": moving,
    "still": still,
    "still with a logo": lambda: branded(still()),
    "vignette": vignetted,
    "hood": hooded,
    "shirt": shirt,
    "black": lambda: [np.zeros((*SIZE[::-1], 3), np.uint8)] * COUNT,
    "veiled logo": lambda: branded(moving(), 0.4),
}


@pytest.mark.parametrize("name", NOTHING)
def test_what_is_not_sure_is_left_alone(name: str, tmp_path: Path) -> None:
    assert found_in(NOTHING[name](), tmp_path / "clip.mp4") is None


def test_the_scene_is_mirrored_as_at_a_border() -> None:
    scene = texture(40, 30)
    mask = np.ones((50, 40), bool)
    mask[10:40] = False
    area = FixedArea(mask)
    picture = np.pad(scene, ((10, 10), (0, 0), (0, 0)), constant_values=7)
    # Rows beside a bar have something of its colour.
    inner = picture[12:38]
    assert np.array_equal(area.without(picture), np.pad(inner, ((12, 12), (0, 0), (0, 0)), mode="symmetric"))


def test_real_clips_have_one_logo(data: Path) -> None:
    found = {}
    for path in sorted((data / "clips").iterdir()):
        footage = open_footage(path)
        found[path.stem] = fixed_area(footage.read, footage.frames)
        footage.close()
    logos = {name: area for name, area in found.items() if area is not None}
    assert list(logos) == ["person_run_indoor_1"]
    x, y, across, down = cv2.boundingRect(logos["person_run_indoor_1"].mask.astype(np.uint8))
    assert 710 < x < 735 and 20 < y < 40 and x + across < 830 and y + down < 75
