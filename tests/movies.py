"""What is seen and heard in a movie."""

from __future__ import annotations

from pathlib import Path

import av
import bpy


def content(movie: Path) -> tuple[list[bytes], list[bytes]]:
    """The decoded frames of a movie and of its sound.

    For comparing movies: the bytes of two files with the same pictures and sound can differ, because
    how packets of picture and sound alternate depends on when the encoder's threads return them (it was
    seen once in CI, as four more chunks of sound in the index).
    """
    with av.open(str(movie)) as file:
        frames = [frame.to_ndarray().tobytes() for frame in file.decode(video=0)]
    with av.open(str(movie)) as file:
        sound = [frame.to_ndarray().tobytes() for frame in file.decode(audio=0)] if file.streams.audio else []
    return frames, sound


def frames_of_sound(movie: Path) -> int:
    """How long the sound of a movie is, in frames of 24 a second; RuntimeError where it has none."""
    scene = bpy.data.scenes.new("listen")
    try:
        return scene.sequence_editor_create().strips.new_sound("s", str(movie), 1, 1).frame_duration
    finally:
        bpy.data.scenes.remove(scene)
