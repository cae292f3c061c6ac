"""Subjects that strokes on the command line mark, and focus on them."""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest

from addon.cli.main import run_command
from addon.core.readers.colmap_export import write_model
from addon.scene.sources.shot import shot_of
from addon.scene.sources.subjects import marked_of

from ..subjects import walls

FRAMES = walls.FRAMES[:16]
AT = 8
X, Y = walls.place(AT)[0] / walls.WIDTH, walls.place(AT)[1] / walls.HEIGHT
STROKE = ("--subject", f"{X - 0.03:.4f},{Y:.4f}", f"{X + 0.03:.4f},{Y:.4f}@{AT}")


@pytest.fixture(scope="module")
def work(registered: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The working folder of the clip with a disc that moves before two walls."""
    folder = tmp_path_factory.mktemp("subjects")
    (folder / "clip").mkdir()
    (folder / "model").mkdir()
    for frame in FRAMES:
        cv2.imwrite(str(folder / "clip" / f"{frame:04d}.png"), walls.with_disc(frame)[..., ::-1])
    write_model(folder / "model", walls.filmed(walls.with_disc, FRAMES).reconstruction)
    words = ("import", folder / "model", "--footage", folder / "clip", "--work", folder / "work")
    assert run_command([str(each) for each in words]) == 0
    return folder / "work"


def save(work: Path, blend: Path, *options: object) -> int:
    words = ("save", work, "--blend", blend, "--method", "features", "--no-copy", "--overwrite", *options)
    return run_command([str(each) for each in words])


def test_a_stroke_is_kept_in_the_blend_and_moves_what_is_under_it(work: Path, tmp_path: Path) -> None:
    assert save(work, tmp_path / "a.blend", *STROKE, "--focus-distance", 6) == 0
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    (subject,) = marked_of(bpy.context.scene.virtual_aperture)
    assert subject.name == "Subject" and subject.strokes[0].frame == AT and subject.strokes[0].adds
    np.testing.assert_allclose(subject.strokes[0].places, [(X - 0.03, Y), (X + 0.03, Y)], atol=1e-4)
    context = shot_of(bpy.context.scene).context
    assert walls.overlap(context.parts.named("Subject").mask(AT), walls.disc(AT)) > 0.85


def test_a_subject_is_kept_in_focus(work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    named = (STROKE[0], f"disc={STROKE[1]}", STROKE[2])
    assert save(work, tmp_path / "a.blend", *named, "--focus-subject", f"disc@{AT}") == 0
    assert f"at frame {AT}, from the subject disc, seen from frame 1 to 16" in capsys.readouterr().out
    scene = bpy.context.scene
    scene.frame_set(AT)
    context = shot_of(scene).context
    place = context.subject_place("disc", AT)
    assert scene.virtual_aperture.focus_distance == pytest.approx(place.distance, rel=1e-3)
    # A repair takes it with it.
    file = tmp_path / "nearer.json"
    stroke = {"kind": "nearer", "frame": AT, "places": [[X, Y]], "radius": 0.1, "amount": 1}
    file.write_text(json.dumps([stroke]))
    assert save(work, tmp_path / "c.blend", *named, "--focus-subject", f"disc@{AT}", "--repair", file) == 0
    bpy.context.scene.frame_set(AT)
    assert bpy.context.scene.virtual_aperture.focus_distance == pytest.approx(place.distance / 2, rel=0.05)
    # One end of a pull.
    assert (
        save(work, tmp_path / "b.blend", *named, "--focus-subject", f"disc@{AT}", "--focus-at", "0.9,0.2@15")
        == 0
    )
    assert len(bpy.context.scene.virtual_aperture.marks.items) == 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--subject", "0.5", "--focus-distance", 6), "the stroke '0.5' is not valid"),
        (("--subject", "0.5,1.5", "--focus-distance", 6), "0.5,1.5 is outside the picture"),
        (("--subject", "cat=", "--focus-distance", 6), "has no places"),
        (("--focus-subject", "cat"), "there is no stroke on a subject 'cat'"),
        ((*STROKE, "--focus-subject", "--focus-distance", 6), "goes with --focus-at alone"),
        ((*STROKE, "--focus-subject", "--focus-at", "0.5,0.5@3"), "focus at subject Subject has no frame"),
    ],
)
def test_what_is_not_understood_is_said(
    work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[object, ...], message: str
) -> None:
    assert save(work, tmp_path / "a.blend", *words) in (1, 2)
    assert message in capsys.readouterr().err and not (tmp_path / "a.blend").exists()
