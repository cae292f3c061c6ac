"""Notes of the last render on single frames, kept for the panel until the next render."""

from dataclasses import dataclass

import bpy

from ...scene.base.events import at

MOST = 10_000
"""Notes that are kept of one render."""


@dataclass(frozen=True)
class FrameNote:
    """A note on one frame or several."""

    text: str
    frames: tuple[int, ...]


_said: list[tuple[str, int, str]] = []
"""Names of scenes, frames and texts."""


def add(scene: bpy.types.Scene, frame: int, text: str) -> None:
    """Keep a note on a frame, without its number at the beginning."""
    if len(_said) < MOST:
        _said.append((scene.name, frame, text.removeprefix(f"Frame {frame} ")))


def of(scene: bpy.types.Scene) -> list[FrameNote]:
    """Return the notes of the last render of this scene, each once with its frames in order."""
    found: dict[str, set[int]] = {}
    for name, frame, text in _said:
        if name == scene.name:
            found.setdefault(text, set()).add(frame)
    return [FrameNote(text, tuple(sorted(frames))) for text, frames in found.items()]


@at("render_init", "load_pre")
def forget(*_: object) -> None:
    """Clear the notes: a render begins, or another file is opened."""
    _said.clear()
