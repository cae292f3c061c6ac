"""An HLG clip in the window: its preview has the light that the clip and its render have.

The viewport is drawn before anything has read the clip's color space, which cannot be read while it is drawn.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from addon.core.media.light import encode_srgb

from ..media.colour_curves import HLG
from ..scenes import texture
from .clips import light_of, write_scene
from .program import EXTENSION, Program
from .screen import Screen
from .steps import SETTINGS, over, running

SIZE = (320, 180)
BUSY = f"__import__('sys').modules['{EXTENSION}.addon.render.viewport.viewport'].PREVIEW.is_busy()"


@pytest.fixture
def program(small_screen: Screen, resources: Path, folder: Path, registered: None) -> Iterator[Program]:
    blend = write_scene(folder / "hlg", SIZE, 8, (1, 2), HLG)
    with running(small_screen, resources, "hdr", blend, tab=False) as made:
        made.ask(
            "bpy.data.objects.remove(bpy.data.objects['Cube'])\n"
            f"{SETTINGS}.method, {SETTINGS}.blur = 'features', 0.02\n"
            "space = view('VIEW_3D')['area'].spaces.active\n"
            "space.region_3d.view_perspective, space.shading.type = 'CAMERA', 'RENDERED'\n"
        )
        made.settle()
        yield made


def seen(program: Program, name: str) -> np.ndarray:
    """(3,) mean of the middle of the camera's frame."""
    # The viewport asks for its picture as it is drawn.
    program.settle()
    program.wait(f"not {BUSY}", 100)
    program.screen.move(*program.middle("VIEW_3D", "HEADER"))
    program.settle()
    (left, top), (right, bottom) = over(program, (0.2, 0.2)), over(program, (0.8, 0.8))
    shot = program.shot(name)[round(top) : round(bottom), round(left) : round(right)]
    return np.asarray(shot.reshape(-1, 3).mean(axis=0))


def test_the_preview_of_an_hlg_clip_has_the_light_of_the_render(program: Program) -> None:
    part = np.s_[SIZE[1] // 5 : -SIZE[1] // 5, SIZE[0] // 5 : -SIZE[0] // 5]
    light = light_of(texture(*SIZE))[part]
    preview = seen(program, "preview")
    assert preview == pytest.approx(255 * encode_srgb(np.clip(light, 0, 1)).mean(axis=(0, 1)), abs=3)
    program.ask("bpy.context.scene.render.image_settings.file_format = 'PNG'")
    assert "complete" in program.render(seconds=120)
    file = program.pictures / "render.png"
    assert program.ask(f"save_result({str(file)!r})") == ""
    rendered = cv2.imread(str(file))
    assert rendered is not None
    assert preview == pytest.approx(rendered[part][..., ::-1].mean(axis=(0, 1)), abs=2)
