"""Frames on disk and a sound become an H.264 clip, by Blender's own FFmpeg.

OpenCV's wheel cannot write H.264, Blender can. Run as `python sample_scenes/clip.py FRAMES_DIR OUT`, it
encodes in a process of its own, which leaves the caller without bpy and its scenes.
"""

from __future__ import annotations

import argparse
import wave
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

RATE = 48_000
"""Samples of sound a second."""


def ticking(seconds: float, seed: int = 7) -> NDArray[np.float64]:
    """A clock's tick-tock over a faint chord: quiet, and easy to tell from silence and from noise."""
    time = np.arange(round(seconds * RATE)) / RATE
    rng = np.random.default_rng(seed)
    since = time % 0.25
    pitch = np.where((time // 0.25) % 2 < 1, 2100.0, 1650.0)
    tick = np.exp(-since * 90) * (np.sin(2 * np.pi * pitch * since) + 0.3 * rng.standard_normal(len(time)))
    chord = sum(np.sin(2 * np.pi * tone * time) for tone in (220.0, 277.2, 329.6))
    fade = np.clip(np.minimum(time, seconds - time) * 10, 0, 1)
    return np.asarray(fade * (0.12 * tick + 0.02 * chord), dtype=np.float64)


def write_sound(path: Path, samples: NDArray[np.float64]) -> None:
    """Mono samples in -1 ... 1 as a 16-bit wave file."""
    with wave.open(str(path), "wb") as sound:
        sound.setnchannels(1)
        sound.setsampwidth(2)
        sound.setframerate(RATE)
        sound.writeframes((np.clip(samples, -1, 1) * 32767).astype("<i2").tobytes())


def encode(frames: list[Path], out: Path, fps: int, sound: Path | None = None, crf: int = 16) -> None:
    """Write pictures of one size as an H.264 clip, with the sound as AAC.

    Raises RuntimeError when Blender wrote nothing.
    """
    import bpy  # here, so that making sounds needs no Blender

    scene = bpy.data.scenes.new("clip")
    try:
        strips = scene.sequence_editor_create().strips
        pictures = strips.new_image("pictures", str(frames[0]), channel=1, frame_start=1)
        for frame in frames[1:]:
            pictures.elements.append(frame.name)
        size = pictures.elements[0]
        if sound is not None:
            strips.new_sound("sound", str(sound), channel=2, frame_start=1)
        scene.frame_start, scene.frame_end = 1, len(frames)
        render = scene.render
        render.resolution_x, render.resolution_y = size.orig_width, size.orig_height
        render.resolution_percentage = 100
        render.fps, render.fps_base = fps, 1.0
        scene.view_settings.view_transform = "Standard"
        render.image_settings.media_type = "VIDEO"
        render.image_settings.file_format = "FFMPEG"
        render.ffmpeg.format = "MPEG4"
        render.ffmpeg.codec = "H264"
        render.ffmpeg.constant_rate_factor = "CUSTOM"
        render.ffmpeg.custom_constant_rate_factor = crf
        render.ffmpeg.ffmpeg_preset = "BEST"
        render.ffmpeg.audio_codec = "AAC" if sound is not None else "NONE"
        render.ffmpeg.audio_bitrate = 96
        render.ffmpeg.audio_channels = "MONO"
        render.filepath = str(out.resolve())
        render.use_file_extension = False
        out.parent.mkdir(parents=True, exist_ok=True)
        out.unlink(missing_ok=True)
        bpy.ops.render.render(animation=True, scene=scene.name)
    finally:
        bpy.data.scenes.remove(scene)
    if not out.is_file() or not out.stat().st_size:
        raise RuntimeError(f"Blender wrote no clip at {out}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("frames", type=Path, help="folder of equally sized PNG files")
    parser.add_argument("out", type=Path, help="the mp4 to write")
    parser.add_argument("--fps", type=int, default=24)
    parser.add_argument("--sound", type=Path, help="a sound file to lay under the pictures")
    parser.add_argument("--crf", type=int, default=16, help="H.264 rate factor: less is better and larger")
    arguments = parser.parse_args()
    frames = sorted(arguments.frames.glob("*.png"))
    if not frames:
        parser.error(f"no PNG files in {arguments.frames}")
    encode(frames, arguments.out, arguments.fps, arguments.sound, arguments.crf)


if __name__ == "__main__":
    main()
