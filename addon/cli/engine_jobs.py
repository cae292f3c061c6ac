"""Jobs of the engine in other processes: frames ahead of its render, CG objects, and calls of a window."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import bpy

from ..core.base import calls
from ..core.base.arrays import LinearRGBA
from ..core.base.errors import UserError
from ..core.base.messages import Progress, send, speak
from ..render import engine
from ..render.cg import cg_process, cycles_layers
from ..render.processes.clip_process import ReceivedShots
from ..render.processes.frames_ahead import DrawnFrame, draw_ahead
from ..render.views.gpu_views import check_gpu, start_gpu
from .blend import open_blend, open_scene
from .options import WORDS


def draw_cg(job: argparse.Namespace) -> None:
    """Draw the CG objects of a scene, as `render.cg_process` asks for them, until the process is ended."""
    open_scene(Path(job.blend), job.scripts)
    cycles_layers.begin(bpy.data.scenes[job.scene], Path(job.folder), job.is_preview)
    calls.serve(Path(job.folder))


def draw_frames(job: argparse.Namespace) -> None:
    """Draw a scene's frames, by its own numbers, for `render.frames_ahead` until its render is over."""
    scene, _, _ = open_blend(Path(job.blend), job.scene, job.scripts)
    check_gpu()

    def draw(frame: int) -> DrawnFrame:
        scene.frame_set(frame)
        with engine.watched() as watch:
            watch.pictures = pictures = dict[str, LinearRGBA]()
            try:
                bpy.ops.render.render(scene=scene.name)
            except RuntimeError as error:
                watch.raise_error()
                raise UserError(str(error).strip()) from error
            watch.check_drawn()
            return DrawnFrame(pictures, tuple(watch.notes))

    numbers = range(*job.frames)
    with cg_process.kept():
        for done, frame in enumerate(draw_ahead(Path(job.into), numbers, job.reach, draw), 1):
            send(Progress("frames", done, len(numbers), frame))


def serve_clip(job: argparse.Namespace) -> None:
    """Compute for a window, as `render.processes.clip_process` asks for it, until the process is ended."""
    start_gpu()
    calls.serve(Path(job.folder), ReceivedShots(Path(job.folder)))


JOBS = {"cg": draw_cg, "clip": serve_clip, "frames": draw_frames}
"""By the name that stands in a job's file."""


def read_job(file: Path, parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Return the options of this process's job, written by `launcher.start`."""
    speak()
    told = json.loads(file.read_text(encoding="utf-8"))
    own = JOBS.get(told["arguments"][0])
    options = argparse.Namespace(command=own, words=WORDS) if own else parser.parse_args(told["arguments"])
    vars(options).update(told, child=True)
    return options
