"""Every command in the documentation's pages does what they say: in one small clip, in the pages' order."""

from __future__ import annotations

import argparse
import re
import shlex
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.cli.main import run_command

from .. import planes

ROOT = Path(__file__).resolve().parents[2]
PAGES = (
    "README",
    "docs/first_clip",
    "docs/focus_pull",
    "docs/lens",
    "docs/masks",
    "docs/compositing",
    "docs/command_line",
)
"""`docs/farm.md` needs other programs; its commands are those of tests/render/test_farm.py."""
OURS = re.compile(r"^(?:python addon/headless\.py|blender -b --python addon/headless\.py --) (.*)$")
NAMES = ("solve ", "report ", "render ", "run ", "inspect ", "save ")
FRAMES = 5


def commands() -> list[str]:
    """What follows the program's name in each command of the pages, once; Blender's own as they are."""
    blocks = [
        re.findall(r"^```\n(.*?)^```", (ROOT / f"{page}.md").read_text(), re.M | re.S) for page in PAGES
    ]
    lines = [line for page in blocks for block in page for line in block.splitlines()]
    ours = [found[1] if (found := OURS.match(line)) else line for line in lines]
    known = (*NAMES, "blender -b ")
    return list(dict.fromkeys(line for line in ours if line.startswith(known)))


@pytest.fixture(scope="module")
def folder(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the commands name: `clip.mp4`, `masks` and `depth`."""
    made = tmp_path_factory.mktemp("pages")
    planes.write_video(made / "clip.mp4", FRAMES)
    for name in ("masks", "depth"):
        (made / name).mkdir()
    mask = np.zeros(planes.SIZE[::-1], np.uint8)
    mask[100:140, 200:230] = 255
    for frame, step in enumerate(np.linspace(-0.5, 0.5, FRAMES), 1):
        cv2.imwrite(str(made / "masks" / f"mask_{frame:04d}.png"), mask)
        cv2.imwrite(str(made / "depth" / f"depth_{frame:04d}.png"), inverse_depth(step))
    return made


def inverse_depth(step: float) -> np.ndarray:
    """(H, W) uint16 of a frame of `planes.sideways`: inverse depth by 200,000, which a map may have."""
    centre, turn = np.array([step, 0.2 * step**2, 0.1 * step]), np.array([0.01 * step, 0.04 * step, 0.0])
    picture = np.zeros(planes.SIZE[::-1], np.uint16)
    for depth, (left, right) in planes.PLANES.items():
        corners = np.array([[x, y, depth] for x, y in ((left, -12), (right, -12), (right, 12), (left, 12))])
        pixels, _ = cv2.projectPoints(corners - centre, turn, np.zeros(3), planes.camera_matrix(), None)
        value = round(200_000 / (depth - centre[2]))
        cv2.fillConvexPoly(picture, np.rint(pixels[:, 0]).astype(np.int32), value)
    return picture


def test_there_are_commands() -> None:
    assert len(commands()) > 8


@pytest.mark.parametrize("command", commands())
def test_a_command_of_the_pages(command: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    if command.startswith("blender"):
        render_blend(shlex.split(command)[2:])
        return
    words = shlex.split(command)
    assert run_command(words) == 0
    for option in ("--out", "--blend"):
        if option in words:
            made = Path(words[words.index(option) + 1])
            assert made.stat().st_size > 0


def render_blend(words: list[str]) -> None:
    """What `blender -b FILE -o OUT -s FIRST -e LAST -a` does."""
    import bpy

    reader = argparse.ArgumentParser()
    reader.add_argument("blend")
    reader.add_argument("-a", action="store_true", required=True)
    for option in ("-o", "-s", "-e"):
        reader.add_argument(option, required=True)
    options = reader.parse_args(words)
    bpy.ops.wm.open_mainfile(filepath=str(Path(options.blend).absolute()))
    scene = bpy.context.scene
    scene.render.filepath, scene.frame_start, scene.frame_end = options.o, int(options.s), int(options.e)
    bpy.ops.render.render(animation=True)
    pattern = Path(bpy.path.abspath(options.o))
    names = [
        f"{frame:0{pattern.name.count('#')}d}.png" for frame in range(int(options.s), int(options.e) + 1)
    ]
    assert sorted(path.name for path in pattern.parent.iterdir()) == names
