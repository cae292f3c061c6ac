"""Jobs of the engine in other processes: frames ahead of its render, CG objects, and calls of a window."""

import argparse

import bpy

from ..core.base.calls import serve
from ..core.base.messages import speak, told
from ..render.cg import cg_process, cycles_layers
from ..render.processes.clip_process import ReceivedShots
from ..render.views.gpu_views import check_gpu, start_gpu
from .blend import open_blend, open_scene
from .options import WORDS


def draw_cg(job: argparse.Namespace) -> None:
    """Draw the CG objects of a scene, as `render.cg_process` asks for them, until the process is ended."""
    open_scene(job.blend, job.scripts)
    cycles_layers.begin(bpy.data.scenes[job.scene], job.folder, job.is_preview)
    serve()


def draw_frames(job: argparse.Namespace) -> None:
    """Draw a scene's frames, as `render.frames_ahead` asks for them, until the process is ended."""
    open_blend(job.blend, job.scene, job.scripts)
    check_gpu()
    with cg_process.kept():
        serve()


def serve_clip(job: argparse.Namespace) -> None:
    """Compute for a window, as `render.processes.clip_process` asks for it, until the process is ended."""
    start_gpu()
    serve(ReceivedShots(job.folder))


JOBS = {"cg": draw_cg, "clip": serve_clip, "frames": draw_frames}
"""By the name that `launcher.start` sends."""


def read_job(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Return the options of this process, which `launcher.start` sends."""
    speak()
    job = told()
    own = JOBS.get(job["arguments"][0])
    options = argparse.Namespace(command=own, words=WORDS) if own else parser.parse_args(job["arguments"])
    vars(options).update(job, child=True)
    return options
