"""The thesis's figures of a clip whose geometry is known, and the script that writes them."""

from __future__ import annotations

import re
import sys
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from addon.core.camera.reconstruction import Image, Intrinsics, Points, Reconstruction, rotation_matrix
from addon.core.media.clip import Footage, open_footage
from addon.core.media.light import decode_srgb
from addon.core.sfm.workspace import Solve
from benchmarks.thesis import __main__ as figures
from benchmarks.thesis import edges, views
from benchmarks.thesis import marks as draw
from benchmarks.thesis.clips import Clip
from sample_scenes.shapes import Shape
from sample_scenes.stage import Cameras, Edge, Prop, Stage

from .. import planes

Floats = NDArray[np.float64]

# Whole figures, of a clip whose cameras, depth and points are known

FRAMES = 12
SCALE = 7.0
"""Units of the "solve" per metre, so that what takes one for the other is found out."""
CORNERS = {
    "A": (-2.2, -1.0, 6.0), "B": (-1.0, -1.0, 6.0), "C": (-1.0, 0.8, 6.0),
    "D": (0.7, 0.8, 4.0), "E": (1.4, -0.9, 4.0), "F": (-0.05, 0.3, 10.0),
}  # fmt: skip
"""On the planes, always seen, and far enough from their borders for flow."""


class Planes(Clip):
    """The textured planes, and as their solve the true cameras and points in other units and axes."""

    def __init__(self, folder: Path) -> None:
        super().__init__("planes")
        self.root = folder
        share = np.linspace(-0.5, 0.5, FRAMES)
        self.centres = np.stack([share, 0.2 * share**2, 0.1 * share], axis=1)
        self.turns = np.stack([0.01 * share, 0.04 * share, 0 * share], axis=1)

    @cached_property
    def stage(self) -> Stage:
        rotation = np.stack([cv2.Rodrigues(turn)[0] for turn in self.turns])
        cameras = Cameras(
            *planes.SIZE, planes.FOCAL, rotation, -np.einsum("nij,nj->ni", rotation, self.centres)
        )
        names = "AB", "BC", "CD", "DE", "CF"
        edges = tuple(Edge(name, np.array([CORNERS[end] for end in name])) for name in names)
        corners = Shape(np.array(list(CORNERS.values())), np.zeros((0, 4), np.int32), np.zeros((0, 4, 2)))
        thing = Prop("card", corners, np.zeros((1, 1, 3), np.float32))
        return Stage("planes", "", cameras, (thing,), np.tile([-1.5, 0.0, 6.0], (FRAMES, 1)), edges=edges)

    @cached_property
    def folder(self) -> Path:
        return self.root

    @cached_property
    def footage(self) -> Footage:
        """`planes.sideways` is of this very path."""
        return open_footage(planes.write_clip(self.root / "clip", planes.sideways(FRAMES)))

    def depth(self, frame: int) -> Floats:
        """Of the nearest plane that each pixel's ray meets."""
        cameras, (width, height) = self.stage.cameras, planes.SIZE
        column, row = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
        ray = np.stack([column, row, np.full_like(row, planes.FOCAL)], axis=-1) / planes.FOCAL
        ray, centre = ray @ cameras.rotation[frame - 1], self.centres[frame - 1]
        nearest = np.full((height, width), np.inf)
        for z, (left, right) in planes.PLANES.items():
            far = (z - centre[2]) / ray[..., 2]
            x = centre[0] + far * ray[..., 0]
            nearest = np.where((x > left) & (x < right), far, nearest)
        return nearest

    def solve(self, focal: float | None = None) -> Solve:
        cameras, middle = self.stage.cameras, self.middle - 1
        xy = np.random.default_rng(4).uniform((5, 5), (315, 235), (60, 2))
        column, row = xy.astype(int).T
        depth = self.depth(self.middle)[row, column]
        ray = np.column_stack([(xy - np.array(planes.SIZE) / 2) / planes.FOCAL, np.ones(60)])
        world = (depth[:, None] * ray - cameras.translation[middle]) @ cameras.rotation[middle]
        turn = rotation_matrix(np.array([0.5, -1.0, 0.3]))
        seen, numbers = cameras.project(world), np.arange(60, dtype=np.int32)
        images = tuple(
            Image(frame, rotation @ turn.T, SCALE * translation, xy, numbers)
            for frame, rotation, translation, xy in zip(
                self.frames, cameras.rotation, cameras.translation, seen, strict=True
            )
        )
        camera = Intrinsics(*planes.SIZE, planes.FOCAL, planes.FOCAL, planes.SIZE[0] / 2, planes.SIZE[1] / 2)
        points = Points(SCALE * world @ turn.T, np.zeros((60, 3), np.uint8), np.zeros(60))
        solved = Reconstruction((camera,), images, points)
        return Solve(self.root, self.root, tuple(self.frames), solved, {"focal": planes.FOCAL})

    def from_beside(self, frame: int, offset: tuple[float, float], focus: float) -> NDArray[np.float32]:
        """Filmed from there, and slid back so that what is in focus stays."""
        centre = self.centres[frame - 1] + self.stage.cameras.rotation[frame - 1].T @ [*offset, 0.0]
        seen = planes.view(centre, self.turns[frame - 1])
        slide = planes.FOCAL * np.array(offset) / focus
        matrix = np.column_stack([np.eye(2), slide])
        back = cv2.warpAffine(seen, matrix, planes.SIZE, borderMode=cv2.BORDER_REPLICATE)
        return decode_srgb(back / 255).astype(np.float32)


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Planes:
    return Planes(tmp_path_factory.mktemp("planes"))


def test_units_of_the_solve_are_told_from_metres(clip: Planes) -> None:
    # The features' places are rounded to the pixels of the depth map.
    assert clip.unit == pytest.approx(SCALE, rel=0.01)
    corner = np.array(CORNERS["B"])
    picked = clip.pick(corner, clip.middle)
    true = clip.stage.cameras.to_camera(corner[None])[clip.middle - 1, 0, 2]
    assert 1 / picked.inverse_depth(clip.reconstruction, clip.middle) == pytest.approx(SCALE * true, rel=0.03)


def rows_of(table: str) -> list[list[str]]:
    lines = [line for line in table.splitlines() if line.startswith("|") and not set(line) <= set("|-")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_lengths_of_known_edges_are_measured(clip: Planes) -> None:
    figure = edges.edge_lengths(clip)
    ratios, corners = (rows_of(part) for part in figure.table.split("\n\n"))
    ends = {name: np.diff([CORNERS[end] for end in name], axis=0) for name in ("AB", "BC", "CD", "DE", "CF")}
    size = {name: float(np.linalg.norm(gap)) for name, gap in ends.items()}
    for name, measured, found, error, given, flow, _ in ratios[1:]:
        over, under = name.split(" / ")
        assert float(measured) == pytest.approx(size[over] / size[under], abs=0.006)
        assert float(found) == pytest.approx(float(measured), rel=0.05)
        assert abs(float(error.split()[0])) < 5
        assert error == given  # its focal length is the same
        if flow:
            assert abs(float(flow.split()[0])) < 1.5
    assert [name.split(" / ")[0] for name, *_ in ratios[1:5]] == ["BC", "CD", "DE", "CF"]
    assert [row[0] for row in corners[1:]] == list(CORNERS)
    for _, marked, miss, followed, flow_miss, slip in corners[1:]:
        assert (marked, followed) == ("5", "12 of 12")  # 1, 4, 7, 10, and the middle one, 6
        # Half a pixel's diagonal is the farthest that a mark can be off.
        assert float(miss.split()[0]) < 0.5**0.5
        assert float(flow_miss.split()[0]) < 0.15
        assert float(slip.split()[0]) <= 0.3


def test_novel_views_are_nearer_to_what_is_seen_from_there(clip: Planes) -> None:
    figure = views.novel_views(clip, (0.2,), "Figure 0")
    score = [float(number) for number in re.findall(r"\d+\.\d(?=[,;. ])", figure.numbers)]
    thesis, ours, as_it_is = score[0:2], score[2:4], score[4]
    assert min(thesis) > as_it_is + 1, figure.numbers
    assert min(ours) > as_it_is + 1, figure.numbers


# The script


def test_every_figure_of_the_project_is_kept_under_its_name() -> None:
    text = (figures.FOLDER / "README.md").read_text(encoding="utf-8")
    for name in figures.makers():
        assert f"![{name}.png]({name}.png)" in text
        file = figures.FOLDER / f"{name}.png"
        assert file.stat().st_size <= draw.LIMIT
    assert len(list(figures.FOLDER.glob("*.png"))) == len(figures.makers())


def made(name: str, table: str = "") -> draw.Figure:
    picture = np.zeros((20, 30, 3), np.uint8)
    return draw.Figure(f"{name}.png", picture, f"Shows {name}.", f"Figure {name}", f"{name}: 1.", table)


def test_the_readme_holds_every_figure() -> None:
    text = figures.readme([made("one"), made("two", "| a | b |\n|---|---|\n")])
    for each in (made("one"), made("two")):
        for words in (f"]({each.name})", each.shows, each.answers, each.numbers):
            assert words in text
    assert "\n\n| a | b |\n" in text, "a table needs an empty line before it"
    assert text.index("one.png") < text.index("two.png") < text.index("| a |")


def test_the_script_writes_what_was_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    both = {name: lambda name=name: made(name) for name in ("a", "b")}
    monkeypatch.setattr(figures, "makers", lambda: both)
    monkeypatch.setattr(sys, "argv", ["figures", "--out", str(tmp_path / "all")])
    figures.main()
    assert {file.name for file in (tmp_path / "all").iterdir()} == {"a.png", "b.png", "README.md"}
    monkeypatch.setattr(sys, "argv", ["figures", "--only", "b", "--out", str(tmp_path / "one")])
    figures.main()
    assert [file.name for file in (tmp_path / "one").iterdir()] == ["b.png"]
    monkeypatch.setattr(sys, "argv", ["figures", "--only", "c", "--out", str(tmp_path / "none")])
    with pytest.raises(SystemExit):
        figures.main()
