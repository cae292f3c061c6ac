"""Screen recordings: a page that scrolls shows no depth, though cameras can be found that explain it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from .. import planes
from ..solving import refused

SIZE, COUNT = (320, 240), 24


def page(height: int) -> NDArray[np.uint8]:
    """(height, 320, 3) pixels of lines of text on white."""
    random = np.random.default_rng(0)
    made = np.full((height, SIZE[0], 3), 250, np.uint8)
    for y in range(16, height, 17):
        line = "".join(
            chr(code) for code in np.where(random.random(44) < 0.18, 32, random.integers(97, 123, 44))
        )
        cv2.putText(made, line, (8, y), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (40, 40, 40), 1, cv2.LINE_AA)
    return made


def scrolled(far: float, fixed: bool) -> list[NDArray[np.uint8]]:
    """Frames of a page that scrolls by `far` pixels, slowly, fast and slowly again.

    A header and a sidebar stay in place if `fixed`.
    """
    whole, side = page(SIZE[1] + round(far) + 2), page(SIZE[1] + 30)[30:]
    frames = []
    for at in far * (1 - np.cos(np.linspace(0, np.pi, COUNT))) / 2:
        shift = np.array([[1, 0, 0], [0, 1, -at]])
        frame = cv2.warpAffine(whole, shift, SIZE, flags=cv2.INTER_LINEAR)
        if fixed:
            frame[:, -70:] = side[:, :70]
            frame[:30] = (90, 60, 40)
            cv2.putText(
                frame, "site  home  about", (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1
            )
        frames.append(np.asarray(frame, np.uint8))
    return frames


@pytest.mark.parametrize("fixed", [False, True], ids=["page", "page with a header"])
def test_a_page_that_scrolls_is_refused(tmp_path: Path, fixed: bool) -> None:
    clip = planes.write_clip(tmp_path / "page", scrolled(138, fixed))
    assert "moves alike, as on a page that scrolls" in refused(clip, tmp_path / "work")
