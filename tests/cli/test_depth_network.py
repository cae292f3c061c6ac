"""A depth network on the command line."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from addon.core.media.clip import open_footage
from addon.core.readers.matching import Imported
from addon.core.sfm.workspace import keep_import

from .. import planes
from ..command_line import done, here
from ..onnx_files import network, node

CAMERA = planes.LENS.scaled(planes.WIDTH // 2, planes.HEIGHT // 2)


def seeing(channel: int, times: float = 1.0) -> bytes:
    """A network that takes one of red, green and blue, from 0 to 2, for inverse depth."""
    weight = np.zeros((1, 3, 1, 1), np.float32)
    weight[0, channel] = times
    return network([node("Conv", ["x", "w"], "y")], {"w": weight}, (1, 3, CAMERA.height, CAMERA.width))


def test_it_is_rendered_as_its_maps_in_files_are(tmp_path: Path, registered: None) -> None:
    """Red is inverse depth in the clip, green and blue are what the planes look like."""
    shown, depths = planes.halved(planes.clip(planes.CENTRES)), []
    for picture, centre in zip(shown, planes.CENTRES, strict=True):
        picture[..., 2] = np.round(1000 * planes.truth(centre, CAMERA))
        depths.append(picture[..., 2] / np.float32(255))
    clip, work = planes.write_clip(tmp_path / "clip", shown), tmp_path / "work"
    np.savez(tmp_path / "maps.npz", depths=np.array(depths))
    solved = planes.poses(planes.CENTRES, planes.features(), CAMERA)
    keep_import(Imported(solved, "COLMAP text", ()), open_footage(clip), work)
    lens = (
        "--focus-point",
        1,
        "--blur",
        0.05,
        "--views",
        8,
        "--method",
        "features",
        "--frames",
        planes.MIDDLE,
    )
    file, drawn = tmp_path / "network.onnx", {}
    file.write_bytes(seeing(0))
    given = {"made": ("--depth", file), "read": ("--depth", tmp_path / "maps.npz"), "none": ()}
    for name, depth in given.items():
        done("render", work, *lens, *depth, "--out", tmp_path / name / "####.png")
        drawn[name] = cv2.imread(str(tmp_path / name / f"{planes.MIDDLE:04d}.png")).astype(int)
    assert np.abs(drawn["made"] - drawn["read"]).max() <= 1
    assert np.abs(drawn["made"] - drawn["none"]).max() > 10
    again = ("render", work, *lens, "--depth", file, "--out", tmp_path / "made" / "####.png")
    assert "1 frame there already" in done(*again)
    file.write_bytes(seeing(0, 2.0))
    assert "was made from other inputs" in here(*again).stderr
    # Green is no depth.
    file.write_bytes(seeing(1))
    assert "(network.onnx) does not fit the clip" in here(*again).stderr
