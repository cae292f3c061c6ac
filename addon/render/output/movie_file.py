"""Pictures on disk become a movie with the clip's times and sound, by Blender's own encoder."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import bpy
import numpy as np

from ...core.base import atomic
from ...core.base.errors import Remedy, UserError
from ...core.base.messages import Progress, send
from ...core.media.clip import Footage
from ...core.media.constant_rate import FASTEST, beginnings, held_frames
from ...core.media.sequence import LAST_FRAME
from ...scene.build import blender_rate
from ...scene.sources.hdr_view import HDR, has_curve
from ...scene.sources.shot import shot_of
from ...scene.sources.sound import SOUND, clip_sounds, sound_file, sound_frame
from ..views.frame_size import written_size
from . import frame_files

MOVIES = {".mp4": "MPEG4", ".mov": "QUICKTIME", ".mkv": "MKV"}
HELD = {".mkv": 1000}
"""Frames a second that a kind of movie holds, if fewer than Blender's: Matroska counts milliseconds."""
RATE_FACTOR = 12
"""H.264's and HEVC's. The clip has been through one encoder already: at Blender's best preset (17) the second
takes up to a seventh of the subject's sharpness."""
HDR_EXPOSURE = float(np.log2(2.03))
"""Stops: Blender reads such a clip with white at 203 cd/m2 (ITU-R BT.2408), and writes it at 100."""
JOINING = "movie"
"""The stage in which all frames are there and the movie is being written."""
STRIP = 500
"""Frames of an image strip: appending one to n copies all n, which takes a minute at 36,000."""


def join(scene: bpy.types.Scene, files: dict[int, Path], out: Path) -> None:
    """Write pictures, by frame number, as a movie with the rate and the sound of a scene.

    Where the clip's rate varies, and the scene's is as the clip set it, the movie has the clip's fastest rate
    and holds slower frames. UserError where the movie that was written does not show exactly these pictures,
    each at its time; then nothing is at its place.
    """
    atomic.collect_orphans(out.parent)
    check_rate(out, scene, sorted(files))
    held, rate, moved = _schedule(scene, sorted(files))
    first = min(files)
    size = written_size(scene.render)
    movie, opened = bpy.data.scenes.new("Virtual Aperture Movie"), ExitStack()
    try:
        _set_movie(movie, scene, out.suffix.lower(), size)
        movie.render.fps, movie.render.fps_base = blender_rate(rate)
        movie.frame_start, movie.frame_end = first, first + len(held) - 1
        strips = movie.sequence_editor_create().strips
        for at in range(0, len(held), STRIP):
            strip = strips.new_image("Frames", str(files[held[at]]), 1, first + at)
            for frame in held[at + 1 : at + STRIP]:
                strip.elements.append(files[frame].name)
        for sound in clip_sounds(scene):
            file = opened.enter_context(sound_file(sound.sound))
            strips.new_sound(SOUND, str(file), 2, moved(sound.frame_start))
        with atomic.staged(out) as part:
            movie.render.filepath = frame_files.blender_path(part)
            send(Progress(JOINING, 1, 1))
            try:
                bpy.ops.render.render(animation=True, scene=movie.name)
            except RuntimeError as error:
                raise UserError(f"Blender could not write {out.name}: {str(error).strip()}") from error
            problem = frame_files.movie_problem(part, len(held), size, rate)
            frame_files.refuse(out, problem or frame_files.shown_problem(part, files, held, size))
    finally:
        bpy.data.scenes.remove(movie)
        opened.close()


def check_rate(out: Path, clip: bpy.types.Scene | Footage, frames: Sequence[int]) -> None:
    """Check before any work that an output, if it is a movie, can hold frames at the rate of a scene or clip.

    Raises:
        UserError: It has too many frames a second for its format, or too many for Blender.
    """
    suffix, pictures = out.suffix.lower(), "write pictures, such as ####.png"
    if suffix not in MOVIES:
        return
    if isinstance(clip, Footage):
        rate = clip.fps if clip.video is None else clip.video.movie_rate
        count = round((clip.seconds(frames[-1]) - clip.seconds(frames[0])) * rate) + 1
    else:
        held, rate, _ = _schedule(clip, list(frames))
        count = len(held)
    most = HELD.get(suffix, FASTEST)
    if rate > most:
        other = "choose a .mp4 or .mov, or " if rate <= FASTEST else ""
        raise UserError(
            f"{out.name} would have {rate:g} frames a second, and {suffix} holds at most {most}; {other}"
            f"{pictures}"
        )
    if count > LAST_FRAME - frames[0]:
        raise UserError(
            f"{out.name} would have {count} frames, of {rate:g} a second, and Blender writes at most"
            f" {LAST_FRAME - frames[0]}; choose fewer frames, or {pictures}",
            Remedy.FRAMES,
        )


def _schedule(scene: bpy.types.Scene, frames: list[int]) -> tuple[list[int], float, Callable[[float], int]]:
    """The clip's frame for each of a movie's frames, the rate, and the place in it of a scene's frame."""
    footage, set_rate = shot_of(scene).footage, scene.render.fps / scene.render.fps_base
    video, first = footage.video, frames[0]
    if video is None or not video.is_variable or abs(set_rate - footage.fps) > 1e-3 * footage.fps:
        shown = np.searchsorted(frames, np.arange(first, frames[-1] + 1), "right") - 1
        return [frames[place] for place in shown], _as_blender(set_rate), round
    rate = _as_blender(video.movie_rate)
    sound = video.sound or 0.0
    seconds = [footage.seconds(frame) for frame in frames]
    # The last is as long as the one before it.
    following = frames[-1] if frames[-1] < video.count else video.count - 1
    end = seconds[-1] + (float(np.diff(video.seconds)[following - 1]) if video.count > 1 else 1 / rate)
    places = held_frames(seconds, end, rate, sound)
    begin = int(beginnings(seconds, rate, sound)[0])

    def moved(frame: float) -> int:
        # The user's shift against the clip's own sound is kept.
        by = (frame - sound_frame(footage)) / set_rate
        return int(first + round(by * rate) - begin)

    return [frames[place] for place in places], rate, moved


def _as_blender(rate: float) -> float:
    whole, base = blender_rate(rate)
    return whole / base


def hdr_display(scene: bpy.types.Scene) -> str:
    """Return the display of Blender's for a scene's movie, HEVC of 10 bits: that of an HDR clip.

    It is empty for other clips, and if the user chose a view.
    """
    space, view = shot_of(scene).space, scene.view_settings
    is_plain = scene.display_settings.display_device == "sRGB" and view.view_transform == "Standard"
    is_plain &= not view.use_curve_mapping or has_curve(view)
    return space.name if space is not None and space.name in HDR and is_plain else ""


def _set_movie(movie: bpy.types.Scene, scene: bpy.types.Scene, suffix: str, size: tuple[int, int]) -> None:
    render, settings = movie.render, movie.render.image_settings
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.pixel_aspect_x, render.pixel_aspect_y = scene.render.pixel_aspect_x, scene.render.pixel_aspect_y
    # The pictures are final; they are not graded or dithered twice.
    movie.view_settings.view_transform, movie.view_settings.look = "Standard", "None"
    if hdr := hdr_display(scene):
        # The pictures are light, which is encoded here.
        view = scene.view_settings
        movie.display_settings.display_device = hdr
        movie.view_settings.exposure, movie.view_settings.gamma = HDR_EXPOSURE + view.exposure, view.gamma
    render.dither_intensity = 0
    frame_files.set_no_stamps(render)
    settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    settings.color_mode = "RGB"
    ffmpeg = render.ffmpeg
    ffmpeg.format = MOVIES[suffix]
    footage = shot_of(scene).footage
    is_deep = footage.is_video and footage.read(footage.frames[0]).dtype != np.uint8
    ffmpeg.codec = "H265" if is_deep or hdr else "H264"
    if is_deep or hdr:
        settings.color_depth = "10"
    ffmpeg.constant_rate_factor = "CUSTOM"
    ffmpeg.custom_constant_rate_factor = RATE_FACTOR
    ffmpeg.ffmpeg_preset = "GOOD"
    sounds = [strip.sound for strip in clip_sounds(scene)]
    ffmpeg.audio_codec = "AAC" if sounds else "NONE"
    if sounds:
        ffmpeg.audio_mixrate = sounds[0].samplerate or ffmpeg.audio_mixrate
        ffmpeg.audio_channels = "MONO" if sounds[0].channels == "MONO" else "STEREO"
