"""Frames and movies through Blender's own output, written beside and moved into place."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable
from pathlib import Path

import bpy

from ..core.errors import Remedy, UserError
from ..core.footage import Footage
from ..core.views import plan_frame
from ..scene.build import SOUND
from ..scene.properties import lens_settings
from ..scene.shot import shot_of
from . import engine

MOVIES = {".mp4": "MPEG4", ".mov": "QUICKTIME", ".mkv": "MKV"}
STILLS = {".png": "PNG", ".exr": "OPEN_EXR"}
RATE_FACTOR = 12
"""H.264's. The clip has been through one encoder already: at Blender's best preset (17) the second takes up
to a seventh of the subject's sharpness."""
MARK = ".virtual_aperture.json"

Report = Callable[[str], None]


def check_output(out: Path, overwrite: bool) -> None:
    """UserError for an output that cannot be written or would overwrite something, before any work."""
    suffix = out.suffix.lower()
    is_still = suffix in STILLS
    if suffix not in MOVIES and not is_still:
        raise UserError(f"{out.name} is no output that is known; end it in {', '.join([*MOVIES, *STILLS])}")
    if is_still and "#" not in out.name:
        raise UserError(f"{out.name} names one file for many frames; write ####{suffix} for frame numbers")
    if not is_still and out.exists() and not overwrite:
        raise UserError(f"{out} exists; name another file, or overwrite it", Remedy.OVERWRITE)
    check_folder(out.parent)


def check_folder(folder: Path) -> None:
    """UserError for a folder that cannot be written, or made."""
    above = next(p for p in [folder, *folder.parents] if p.exists())
    if not above.is_dir() or not os.access(above, os.W_OK):
        raise UserError(f"{above} cannot be written; choose another output folder")


def plan_all(scene: bpy.types.Scene, frames: list[int]) -> tuple[int, int]:
    """Plan every frame, so that what is wrong shows before an hour of rendering.

    Returns the smallest and the largest number of views.
    """
    shot = shot_of(scene)
    lens = lens_settings(scene.virtual_aperture, shot.reconstruction)
    size = engine.render_size(scene.render)
    counts = [len(plan_frame(shot.reconstruction, frame, lens, size, shot.depth).offsets) for frame in frames]
    return min(counts), max(counts)


def render_sequence(
    scene: bpy.types.Scene, frames: list[int], out: Path, overwrite: bool, report: Report
) -> None:
    """Render frames to `out`, whose #### is the frame number. Goes on where an equal run stopped."""
    out.parent.mkdir(parents=True, exist_ok=True)
    mark = out.parent / MARK
    key = run_key(scene)
    targets = {frame: out.with_name(_numbered(out.name, frame)) for frame in frames}
    there = [path for path in targets.values() if path.exists()]
    same = mark.exists() and json.loads(mark.read_text()).get(out.name) == key
    if there and not same and not overwrite:
        raise UserError(
            f"{there[0]} exists and was made with other settings or by something else;"
            " name another folder, or overwrite it",
            Remedy.OVERWRITE,
        )
    marks = json.loads(mark.read_text()) if mark.exists() else {}
    mark.write_text(json.dumps(marks | {out.name: key}))
    _set_still(scene, out.suffix.lower(), shot_of(scene).footage)
    todo = [f for f in frames if not (same and targets[f].exists())]
    if len(todo) < len(frames):
        report(f"{len(frames) - len(todo)} frames are there already")
    clock = _Clock(len(todo), report)
    for frame in todo:
        part = targets[frame].with_name(f".part-{targets[frame].name}")
        try:
            scene.frame_set(frame)
            scene.render.filepath = str(part)
            engine.clear_error()
            bpy.ops.render.render(write_still=True, scene=scene.name)
            engine.raise_error()
            part.replace(targets[frame])
        except RuntimeError:
            engine.raise_error()
            raise
        finally:
            part.unlink(missing_ok=True)
        clock.tick(frame)


def render_movie(scene: bpy.types.Scene, frames: list[int], out: Path, report: Report) -> None:
    """Render a movie with the clip's rate and sound. A gap in the clip holds the frame before it."""
    out.parent.mkdir(parents=True, exist_ok=True)
    part = out.with_name(f".part-{out.name}")
    _set_movie(scene, out.suffix.lower())
    scene.frame_start, scene.frame_end = frames[0], frames[-1]
    scene.render.filepath = str(part)
    clock = _Clock(frames[-1] - frames[0] + 1, report)

    def written(rendered: bpy.types.Scene, _: object = None) -> None:
        clock.tick(rendered.frame_current)

    engine.clear_error()
    bpy.app.handlers.render_write.append(written)
    try:
        bpy.ops.render.render(animation=True, scene=scene.name)
        engine.raise_error()
        if not part.exists():
            raise UserError(f"Blender wrote no movie to {part}; is the disk full?")
        part.replace(out)
    except RuntimeError as error:
        engine.raise_error()
        raise UserError(f"Blender could not write {out.name}: {str(error).strip()}") from error
    finally:
        bpy.app.handlers.render_write.remove(written)
        part.unlink(missing_ok=True)


def _set_still(scene: bpy.types.Scene, suffix: str, footage: Footage) -> None:
    settings = scene.render.image_settings
    settings.media_type = "IMAGE"
    settings.file_format = STILLS[suffix]
    settings.color_mode = "RGBA" if suffix == ".exr" else "RGB"
    deep = footage.read(footage.frames[0]).dtype != "uint8"
    settings.color_depth = {".png": "16" if deep else "8", ".exr": "32" if deep else "16"}[suffix]


def _set_movie(scene: bpy.types.Scene, suffix: str) -> None:
    settings = scene.render.image_settings
    settings.media_type = "VIDEO"
    settings.file_format = "FFMPEG"
    settings.color_mode = "RGB"
    ffmpeg = scene.render.ffmpeg
    ffmpeg.format = MOVIES[suffix]
    ffmpeg.codec = "H264"
    ffmpeg.constant_rate_factor = "CUSTOM"
    ffmpeg.custom_constant_rate_factor = RATE_FACTOR
    ffmpeg.ffmpeg_preset = "GOOD"
    editor = scene.sequence_editor
    sounds = [s.sound for s in editor.strips if s.name.startswith(SOUND)] if editor is not None else []
    ffmpeg.audio_codec = "AAC" if sounds else "NONE"
    if sounds:
        ffmpeg.audio_mixrate = sounds[0].samplerate or ffmpeg.audio_mixrate
        ffmpeg.audio_channels = "MONO" if sounds[0].channels == "MONO" else "STEREO"
    _crop_to_even(scene.render)


def _crop_to_even(render: bpy.types.RenderSettings) -> None:
    """H.264 stores colour for two by two pixels: an odd last row or column is cut off."""
    width, height = engine.render_size(render)
    if width % 2 or height % 2:
        render.use_border = render.use_crop_to_border = True
        render.border_min_x, render.border_max_x = 0.0, (width - width % 2) / width
        render.border_min_y, render.border_max_y = (height % 2) / height, 1.0


def _numbered(name: str, frame: int) -> str:
    """#### replaced by the frame number."""
    start = name.index("#")
    width = len(name[start:]) - len(name[start:].lstrip("#"))
    return name[:start] + f"{frame:0{width}d}" + name[start + width :]


def run_key(scene: bpy.types.Scene) -> str:
    """What the pictures depend on, so that a run only continues its own like."""
    shot = shot_of(scene)
    lens = lens_settings(scene.virtual_aperture, shot.reconstruction)
    camera = shot.reconstruction.images[0].centre.tobytes() + shot.reconstruction.points.xyz.tobytes()
    maps = (str(shot.depth.maps.maps.path), shot.depth.fit.line.tolist()) if shot.depth else None
    settings = scene.virtual_aperture
    masks = settings.masks, settings.mask.name_full if settings.mask else ""
    text = repr((lens, maps, masks, engine.render_size(scene.render), hashlib.sha256(camera).hexdigest()))
    return hashlib.sha256(text.encode()).hexdigest()


class _Clock:
    """Progress lines with the time left."""

    def __init__(self, total: int, report: Report) -> None:
        self._total, self._report = total, report
        self._start = time.monotonic()
        self._done = 0

    def tick(self, frame: int) -> None:
        self._done += 1
        each = (time.monotonic() - self._start) / self._done
        left = round(each * (self._total - self._done))
        self._report(
            f"frame {frame}: {self._done} of {self._total}, {each:.1f} s a frame,"
            f" {left // 60} min {left % 60:02d} s left"
        )
