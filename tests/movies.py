"""What is heard in a movie."""

from __future__ import annotations

from pathlib import Path

import bpy


def frames_of_sound(movie: Path) -> int:
    """How long the sound of a movie is, in frames of 24 a second; RuntimeError where it has none."""
    scene = bpy.data.scenes.new("listen")
    try:
        return scene.sequence_editor_create().strips.new_sound("s", str(movie), 1, 1).frame_duration
    finally:
        bpy.data.scenes.remove(scene)
