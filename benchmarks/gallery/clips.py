"""The real clips: where a user clicks, and where the subject is in the middle frame.

Outlines were drawn by hand on the middle frame, within about 1 % of the picture's width. Where the data has a
mask of every pixel (folder `masks`), that is the subject instead.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from addon.core.media.clip import Footage, open_footage

from .. import store
from .row_outlines import OUTLINES

Mask = NDArray[np.bool_]
Corners = tuple[tuple[float, float], ...]

DATA = Path(os.environ.get("VA_DATA", store.ROOT.parent / "shared" / "data"))
IN_A_ROW = 6
"""Frames of a row, spread over the clip. Each has a true mask or an outline in `row_outlines`."""
CONSECUTIVE = 3
"""Frames from the middle one on that are rendered with a click, for flicker."""


@dataclass(frozen=True)
class RealClip:
    """A clip of the data, a click on its subject, and the subject's outline."""

    path: str
    """Below the data's folder."""
    kind: str
    """person, animal, vehicle or still."""
    click: tuple[float, float]
    """Place on the subject in the middle frame, in shares of width and height from the top left."""
    outline: Corners = ()
    """Corners of the subject in the middle frame in per cent of width and height; empty where masks exist."""
    has_row: bool = False
    row_begins: int = 0
    """First frame of the row as an index into the clip's frames; 0 is the clip's first."""

    @property
    def name(self) -> str:
        """Short name in tables and on sheets."""
        path = Path(self.path)
        return path.parent.name if path.stem in ("demo", "images") else path.stem

    @property
    def file(self) -> Path:
        """The clip."""
        return DATA / self.path

    @cached_property
    def footage(self) -> Footage:
        """The opened clip."""
        return open_footage(self.file)

    @property
    def middle(self) -> int:
        """Number of the middle frame."""
        frames = self.footage.frames
        return int(frames[len(frames) // 2])

    @property
    def near_middle(self) -> tuple[int, ...]:
        """Numbers of the consecutive frames from the middle one on."""
        return tuple(range(self.middle, self.middle + CONSECUTIVE))

    @property
    def row(self) -> range:
        """Numbers of the frames of the row, evenly spread."""
        first, last = self.footage.frames[self.row_begins], self.footage.frames[-1]
        step = (last - first) // (IN_A_ROW - 1)
        return range(first, first + step * (IN_A_ROW - 1) + 1, step)

    def drawn_mask(self, frame: int) -> Mask | None:
        """(H, W) the true mask of the data for a frame; None where there is none."""
        file = DATA / "masks" / self.name / f"{frame - 1:05d}.png"
        if not file.is_file():
            return None
        picture = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        if picture is None:
            raise SystemExit(f"{file} cannot be read as a picture; fetch the test data again")
        size = self.footage.width, self.footage.height
        return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_NEAREST) > 127)

    def subject(self, frame: int) -> Mask:
        """(H, W) the subject: the true mask, or else the outline drawn on a frame of the row, or the middle
        frame's for those near it."""
        mask = self.drawn_mask(frame)
        if mask is not None:
            return mask
        drawn = OUTLINES.get(self.name, {}).get(frame)
        size = self.footage.width, self.footage.height
        return polygon(corners(drawn) if drawn else self.outline, size)


def polygon(corners: Corners, size: tuple[int, int]) -> Mask:
    """(height, width) pixels within corners given in per cent of `size`, (width, height)."""
    filled = np.zeros(size[::-1], np.uint8)
    pixels = np.rint(np.array(corners) / 100 * size).astype(np.int32)
    return np.asarray(cv2.fillPoly(filled, [pixels], 1) > 0)


def corners(text: str) -> Corners:
    """From "x,y x,y ..."."""
    pairs = (pair.split(",") for pair in text.split())
    return tuple((float(x), float(y)) for x, y in pairs)


def files(data: Path = DATA) -> set[str]:
    """Paths below `data` of the clips that a gallery must show: those of `clips`, and the duck."""
    found = {f"clips/{path.name}" for path in (data / "clips").iterdir() if path.is_file()}
    return found | {"duck/demo.mp4"}


CLIPS = (
    RealClip("clips/person_walk_away_1.mp4", "person", (0.485, 0.62), corners(
        "47.7,48 49.5,47.3 50,51 49.5,53 51.5,55.5 52.3,60 52.2,65 51.3,68 50.3,74 50,81 49,83.5 49,87.5"
        " 47.7,88 47.8,84 47.3,81 46.8,75 46,69 45,65 45,60 45.8,55.5 47.8,53"
    ), has_row=True),
    RealClip("clips/people_two_talk_street_1.mp4", "person", (0.62, 0.6), corners(
        "29,29 32,25.5 36,26 38.5,29.5 39.3,37 38,46 38.5,52 42,58 41,64 44.5,62 49,55 51,51 53,52 56.5,50.5"
        " 58,48 55,42 54,36 53,31 54.5,23 58,19 62,19.5 64.5,24 65,31 63.5,43 67,43.5 70.5,47 75,54 77,68"
        " 79,88 77,92 77,100 52,100 51.5,86 52,66 51.5,63 47,66 40,80 39,88 40,100 23,100 22.5,92 23,80 20,63"
        " 21,56 24,49 28,47 28,38"
    )),
    RealClip("clips/person_ball_portrait_1.mp4", "person", (0.36, 0.4), corners(
        "14,28 19,26.5 25,28.5 28,31 36,30.3 42,32.5 47,37 51,40.5 51.5,44 53,47 56,50 56,54 60,58 64,64"
        " 68,71 66,75.5 63,77 58.5,76.5 60,72.5 58,67 52,59.5 46,55.5 39,52 35,57 30,62 30,73 26,75.5 20,77.3"
        " 15.5,76.5 20,72.5 22,71 22,60 24.5,51 24,44 22,39 18,35.5 15,34"
    )),
    RealClip("clips/people_two_portrait_1.mp4", "person", (0.74, 0.36), corners(
        "67,23 71,21.7 76,22.5 78,24 77,27 80,29.5 81.5,33 80.5,41 81,45 79.5,51 77.5,58 78,64 76,66.2"
        " 71,65.8 70,63.5 66,63.7 69.5,61 69.5,56 68,50 69,44 64.5,41.5 62,43 60,42.5 61,40.5 65,39.5 69.5,36"
        " 69.5,31 71,29 68.5,28 66.5,25.5"
    )),
    RealClip("clips/person_run_indoor_1.mp4", "person", (0.47, 0.35), corners(
        "42,5 45,2 48.5,3 49.5,9 48.5,15 49,18 53.5,19.5 57,25 59.5,33 58.5,37 54.5,40.5 55,50 54,57 51.5,66"
        " 51,73 50,80 51.5,88 52.5,95 52,100 48.5,98 46.5,88 45.5,78 44.5,70 42.5,62 41.5,54 42,45 41,38"
        " 39.5,42 37,40.5 36.5,36 39,28 40.5,21 44,18 41.5,12"
    )),
    RealClip("clips/person_dance_davis_1.mp4", "person", (0.48, 0.47), has_row=True),
    RealClip("clips/person_door_dark_1.mp4", "person", (0.7, 0.45), corners(
        "58,11 60.5,6 64,4.5 68,8 68.5,13 68,21 73,24 77.5,30 79.5,38 79.5,58 80,66 78,74 76,82 74.5,92"
        " 76,100 65,100 65,88 66,76 64.5,68 62.5,58 60,49 58,44.5 51,55 46,58 41,59 41,55 46,53 52,46 56,40"
        " 58,34 62,29.5 59.5,26 58.5,20"
    )),
    RealClip("clips/person_run_towards_1.mp4", "person", (0.5, 0.68), corners(
        "48,14.3 52,14.5 56,16.5 60,19 63,23.5 66.5,29 69.5,35 71.5,42 72.3,50 71.5,54 70,56.5 74,60 77.5,68"
        " 80,76 82,84 82.3,89 81,95.5 78.5,98 75,99.2 69.5,98.5 69,100 24,100 17,100 15.5,95 15,90 17,84.5"
        " 19,76.5 21,68 24,60 27,56 31,55 34.5,52 38.5,50.5 38.7,46 40,44.5 37.5,43 37.5,37 38.5,31 39.2,25"
        " 41,19.5 44.5,15.5"
    )),
    RealClip("clips/person_selfie_hevc_rot_1.mp4", "person", (0.5, 0.45), corners(
        "20,29 19.5,25.5 22.5,24 27,24.5 31,26.5 34,23.5 38.5,23.5 42.5,22 47,21.7 52,22 56,22 59,24 62,27"
        " 66.5,30 71,32 76,35.5 78.5,38.7 81.5,41 83,46 82.5,49.5 85.5,52 88,58 88,63 86.5,66 81.5,66 79.5,69"
        " 77,71 76,77 80.5,81.5 84,85.5 91,88 100,90 100,100 0,100 0,86 10,84.3 20,83.7 26,84 30,82.5 32,82"
        " 30,78 29,75 26.5,76.5 22.5,76 19,72.5 16.5,67 16.5,63 18.5,61.5 18.5,57.5 15,54.5 15.5,53.3 17,53.3"
        " 17.2,48 16,47.3 17.5,42 19.5,39.8 17.5,36"
    )),
    RealClip("clips/person_tennis_vfr_1.mp4", "person", (0.3, 0.45), corners(
        "26.5,26 28,24 30,23.5 32.5,24.5 34,27 35,30 34,33 37,33.5 41,34.5 46,33.5 52,31 53.5,29 56,28"
        " 58.5,28.5 58.8,32 58,34 55,34 52,33.5 46,36 40.5,38 39,40 36.5,40 35,45 34,53 33.8,56 35,60"
        " 36.5,66 37,71 35.5,74.5 34.5,81 34,85.5 36,87 39.5,89.5 39.5,91.5 35,92 31.5,90 30,89.5 31,81"
        " 31.5,71 28,71 26.5,74 25,83 25,88.5 30.5,92 31,94.5 26,95 22,94 21.8,86 21.5,73 21,70.5 21.5,60"
        " 21.5,55 21,49 21,42 18,44 15,47 12,50.5 10.5,55 10.5,59 13,63 14,67 13,72 9,75.3 6,74 4,69.5"
        " 4,65 6.5,61 8.5,59 8.5,54 9,51 10,47 13,43 16,39.5 19,36.5 22,34.5 27,33 27.5,31 26.5,28"
    )),
    RealClip("clips/person_road_cup_portrait_1.mp4", "person", (0.42, 0.48), corners(
        "33,22.5 40,21.7 48,22.2 55,24.5 59,28 62,32 63.5,36 66,40.5 72,43 76.5,43.7 80,46.5 83,51 85.5,56"
        " 87.5,60 86,64 85,68 81,69 81.5,73 79,80 75,84.5 68,87 57,89.5 52,91 54,94.5 51,98 49,100 0,100 0,96"
        " 12,93.5 13,89.5 8,85 4,78.5 3,71.5 0,69 0,53.5 5,51 11,47.5 16,45.5 20,42 22,38 23,33.5 26,28.5"
    )),
    RealClip("clips/backpack.mp4", "person", (0.57, 0.42), corners(
        "0,0 26,0 31,9.5 35,13 45,14.3 52,13.3 57.5,15.5 56,18 57,21.5 61,23.5 66,27 71.5,29 71.5,35.5 68,41"
        " 66,48 60,55.5 53,59.5 45,56 41,55.5 43.5,39 47,33.5 51,28.5 54,24 50,21.5 45.5,18.5 35,19.5 29,19"
        " 24.5,15.5 25,25 28,33 30,38 31.5,54 34.5,61 33.5,70 37,76 35,80 32,80 28.5,70 28,64 24,59 16,53.5"
        " 18.5,70 20,76 18.5,82 15,83.5 12.5,80 13,73 5,58 0,52"
    )),
    RealClip("clips/night_walker.mp4", "person", (0.49, 0.45), corners(
        "47.5,22.5 50,20.5 51.5,22.5 51.7,29 51,32 54,34 54.7,40 54.8,55 55,62 54,63 53.7,70 53.7,81 51.5,81"
        " 51.3,85 50.5,95 48.3,95 48,90 49,85 49,80 45,80 45,62 44.2,61 43.8,75 41.8,75 42.3,66 43,60 43.5,50"
        " 44.3,38 45,34 47.5,32.5 47.2,28"
    ), has_row=True, row_begins=29),
    RealClip("clips/paraglider.mp4", "person", (0.49, 0.65)),
    RealClip("clips/robot.mp4", "person", (0.51, 0.38), corners(
        "56,8 59.5,8 59.5,10 57.5,15 57.5,33 61,24 63.5,19 67,16.5 69.5,19 65,22 63.5,30 60.5,41 66.5,43"
        " 66,48 58,47 54,48 53.7,57 52.5,60.5 50,60 49.8,68 47.5,72 44.5,69 45.5,62 44,58 42,52 41.5,40 44,38"
        " 47.5,37 46,28 48,23 52,21.5 53.5,24 54,17 53.5,15"
    )),
    RealClip("clips/animal_cow_davis_1.mp4", "animal", (0.45, 0.4)),
    RealClip("clips/animal_goat_davis_1.mp4", "animal", (0.71, 0.46)),
    RealClip("clips/animal_kitten_1.mp4", "animal", (0.54, 0.6), corners(
        "43,8 47,3 52,0 70,0 71,8 74,10 80,11 84,16 90,18 95,17 99,20 94,23 86,25 82,21 78,15 73,18 66,20"
        " 61,24 58,29 56,33 57,40 61,45 66,47 70,54 69,59 65,61 63,70 59,78 53,80 49,83 50,100 38,100 40,84"
        " 39,60 37,51 36,42 36,30 38,21 41,14"
    )),
    RealClip("clips/cat.mp4", "animal", (0.72, 0.33), corners(
        "57,18 63,23 70,22.5 80,23.5 88,19 87,26 88,33 88,40 85,46 82,52 74,58 67,64 65,70 66,75 64,77 66,82"
        " 70,85 66,89 60,87 54,78 50,73 47,74 45,78 40,79 30,77.5 22,75 16,68 13,59 6,55 0,51 3,48 9,47.5"
        " 16,51 19,50 24,44 30,38 38,35 46,34.5 50,32 52,29 56,26"
    )),
    RealClip("clips/dog.mp4", "animal", (0.57, 0.66), corners(
        "50,0 54,1 57,9 59.5,17 61,23 63,31 63.3,40 63,45 65,42 66.3,47 65.5,56 64,61 63.3,66 62.5,71 61,77"
        " 59.5,82.5 57,83.5 56.5,88 53,89.5 51.5,84 50.5,74 49.7,66 50,55 50.5,42 51.5,36 51.5,30 52.5,25"
        " 55,20 55,13 53,7"
    ), has_row=True),
    RealClip("clips/vehicle_car_roundabout_davis_1.mp4", "vehicle", (0.52, 0.58)),
    RealClip("clips/vehicle_scooter_davis_1.mp4", "vehicle", (0.64, 0.4)),
    RealClip("clips/still_garden_shaky_1.mp4", "still", (0.8, 0.55), corners(
        "57,49 62,48 80,50 100,52 100,62 85,60 70,56.5 57,54.5"
    )),
    RealClip("clips/still_roof_hlg10_rot_1.mp4", "still", (0.4, 0.5), corners("12,42.5 85,42 86,56 12,55")),
    RealClip("clips/still_trees_1.mp4", "still", (0.56, 0.75), corners(
        "53.5,55 57,55 57,75 58,88 54,89 54,75"
    )),
    RealClip("clips/night_hall_lights_1.mov", "still", (0.5, 0.3), corners("36,23 69,23 69,38 36,38")),
    RealClip("clips/plant_on_desk.mp4", "still", (0.53, 0.68), corners(
        "20,0 64,0 65,8 59,18 52,21 52,30 49,36 51,45 52,50 62,51.5 65,54 63,66 61.5,80 55,83 48,82 46,75"
        " 43,66 40.5,62 44,54 49,53 46,42 42,36 33,37 25,36 23,32 27,22 22,18"
    )),
    RealClip("duck/demo.mp4", "still", (0.5, 0.7), corners(
        "50.5,54.5 60,57 60,58 52,58.5 51.5,60.5 55,62.5 58,66 58.5,70 57,73 60,76 57,79 52,80.3 45,80 42,77"
        " 41.5,73.5 44,71.5 43.5,67 46,63 50,60.5 50,58 44,59 43.5,58.5 50,56.5"
    )),
    RealClip("room/images", "still", (0.48, 0.62), corners(
        "33,42 46,37 49,38 55,47 57,54 56.5,78 34,79 32,66 32.5,50"
    )),
)  # fmt: skip
NAMES = tuple(clip.name for clip in CLIPS)
