"""What is seen and heard in a movie."""

from __future__ import annotations

from pathlib import Path

import av
import bpy
import numpy as np
from numpy.typing import NDArray

SAME = 45.0
"""Least peak signal-to-noise ratio, in dB, of frames of two movies that show the same picture. x264 does not
give the same stream each time: of 60 runs on the same 48 pictures two gave another, 52 dB from the first,
with one thread or more. A frame's neighbour in the tests' clips is 25 dB away, another rate factor (14 for
12) 43."""


def content(movie: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The decoded frames of a movie (count, rows, W), 8-bit YUV planes below one another, and its sound
    (channels, samples)."""
    with av.open(str(movie)) as file:
        frames = [frame.to_ndarray() for frame in file.decode(video=0)]
    with av.open(str(movie)) as file:
        sound = [frame.to_ndarray() for frame in file.decode(audio=0)] if file.streams.audio else []
    return np.array(frames, float), np.concatenate(sound, axis=1).astype(float) if sound else np.zeros((0, 0))


def assert_same(movie: Path, other: Path) -> None:
    """AssertionError unless two movies show the same pictures (see `SAME`) and have exactly the same sound.

    Their bytes can differ besides: how packets of picture and sound alternate depends on when the encoder's
    threads return them.
    """
    (frames, sound), (others, other_sound) = content(movie), content(other)
    assert frames.shape == others.shape
    error = np.mean((frames - others) ** 2, axis=(1, 2))
    assert np.all(error <= 255**2 / 10 ** (SAME / 10)), f"frames differ, with mean squared errors {error}"
    assert np.array_equal(sound, other_sound)


def frames_of_sound(movie: Path) -> int:
    """How long the sound of a movie is, in frames of 24 a second; RuntimeError where it has none."""
    scene = bpy.data.scenes.new("listen")
    try:
        return scene.sequence_editor_create().strips.new_sound("s", str(movie), 1, 1).frame_duration
    finally:
        bpy.data.scenes.remove(scene)
