"""The examples in docstrings: each runs, and what it makes works."""

from __future__ import annotations

import doctest
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from addon.core.camera.canvas import Canvas
from addon.core.camera.reconstruction import Intrinsics
from addon.core.depth.source import NO_PICTURE, DepthSource, PixelDepth
from addon.core.focus.focus import Focus
from addon.core.frame.clip_context import ClipContext
from addon.core.frame.frame import Mesher
from addon.core.frame.frame_path import mesh_frame
from addon.core.frame.highlights import HighlightSettings
from addon.core.frame.meshers import MESHERS
from addon.core.frame.plan import FrameOptions
from addon.core.media.clip import open_footage
from addon.core.media.light import to_linear
from addon.core.optics.thin_lens import ThinLens
from addon.core.readers import Reader, read_reconstruction
from addon.core.readers.colmap_export import write_model
from addon.core.warp.layer import Layer
from addon.core.warp.mesh import feature_mesh

from .scenes import LENS, slanted_plane, texture, write_frames


def after(thing: type, **names: Any) -> dict[str, Any]:
    """Run the example of a class with some names; the names that it leaves."""
    (example,) = doctest.DocTestFinder(recurse=False).find(thing, globs=names)
    found = doctest.DocTestRunner().run(example, clear_globs=False)
    assert found.attempted and not found.failed
    return example.globs


def test_a_thin_lens() -> None:
    after(ThinLens, ThinLens=ThinLens, Intrinsics=Intrinsics, np=np)


def test_a_depth_source() -> None:
    made = after(DepthSource, DepthSource=DepthSource, PixelDepth=PixelDepth, np=np)["Wall"]()
    assert (made.at(1, Canvas(LENS), NO_PICTURE).inverse_depth == 1 / 3).all()


def test_a_clip_context(tmp_path: Path) -> None:
    footage, reconstruction = open_footage(write_frames(tmp_path / "clip", LENS)), slanted_plane(LENS)
    made = after(
        ClipContext, ClipContext=ClipContext, HighlightSettings=HighlightSettings,
        footage=footage, reconstruction=reconstruction,
    )  # fmt: skip
    assert made["depth"].confidence is not None


def test_a_reader(tmp_path: Path) -> None:
    footage, folder = open_footage(write_frames(tmp_path / "clip", LENS)), tmp_path / "model"
    folder.mkdir()
    write_model(folder, slanted_plane(LENS))
    after(Reader, read_reconstruction=read_reconstruction, footage=footage, folder=folder)


def test_a_mesher(monkeypatch: pytest.MonkeyPatch) -> None:
    made = after(Mesher, Mesher=Mesher, Layer=Layer, feature_mesh=feature_mesh)["plain"]
    monkeypatch.setitem(MESHERS, made.name, made)
    clip = ClipContext(slanted_plane(LENS), lambda frame: texture(LENS.width, LENS.height))
    options = FrameOptions(Focus(distance=8.0), 0.5, 8, made.name)
    frame = mesh_frame(
        clip, 2, options, (LENS.width, LENS.height), to_linear(texture(LENS.width, LENS.height))
    )
    assert frame.mesher is made and len(frame.mesh.triangles)
