"""The sound of a clip as a strip of the scene's sequencer, so that movie output carries it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from ...core.base import atomic
from ...core.base.errors import UserError
from ...core.media.clip import Footage
from ...core.media.container import copy_sound
from ..base.paths import relative

SOUND = "Virtual Aperture Sound"


def clip_sounds(scene: bpy.types.Scene) -> list[bpy.types.SoundStrip]:
    """Return the strips of the clip's sound."""
    editor = scene.sequence_editor
    return [s for s in editor.strips if s.name.startswith(SOUND)] if editor is not None else []


def set_sound(scene: bpy.types.Scene, footage: Footage) -> None:
    """Replace the strips of the clip's sound.

    Blender plays only the first sound track of a file. If the clip's is a later one
    (`VideoInfo.sound_track`), a copy of the track is packed into the .blend.
    """
    editor = scene.sequence_editor
    for strip in clip_sounds(scene):
        editor.strips.remove(strip)
    video = footage.video
    if video is None or video.sound is None:
        return
    editor = editor or scene.sequence_editor_create()
    channel = 1 + max((s.channel for s in editor.strips), default=0)
    with atomic.temporary_folder() as folder:
        file = footage.path
        if video.sound_track:
            file = folder / "sound.mka"
            copy_sound(footage.path, video.sound_track, file)
        try:
            strip = editor.strips.new_sound(SOUND, str(file), channel, 1)
        except RuntimeError:
            return
        if strip.content_duration <= 1:
            editor.strips.remove(strip)
            return
        if video.sound_track:
            strip.sound.pack()
    move_sound(strip, footage)
    strip.frame_start = sound_frame(footage)


def move_sound(strip: bpy.types.SoundStrip, footage: Footage) -> None:
    """Have a strip name the place where the clip lies now."""
    strip.sound.filepath = relative(footage.path)


@contextmanager
def sound_file(sound: bpy.types.Sound) -> Iterator[Path]:
    """Yield the file of a sound, within it also that of one that is packed into the .blend."""
    if sound.packed_file is None:
        yield Path(bpy.path.abspath(sound.filepath))
        return
    with atomic.temporary_folder() as folder:
        file = folder / "sound.mka"
        try:
            file.write_bytes(sound.packed_file.data)
        except OSError as error:
            raise UserError(f"the clip's sound cannot be written to {file}: {error.strerror}") from error
        yield file


def sound_frame(footage: Footage) -> int:
    """Return the frame of the timeline at which a clip's sound begins: strips lie at whole frames.

    The clip's first picture is frame 1, whatever range is rendered.
    """
    start = footage.video.sound if footage.video is not None else None
    return 1 + round((start or 0.0) * footage.fps)
