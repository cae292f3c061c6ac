"""How many processes a command takes."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from ..core.base import limits
from ..render.processes import jobs
from ..scene.sources.shot import Shot
from .options import whole

MOST_JOBS = 1000
"""Processes that can be asked for: no machine has so many processors to itself."""


def add_jobs(command: argparse.ArgumentParser) -> None:
    """Add `--jobs`."""
    command.add_argument(
        "--jobs", type=whole(1, MOST_JOBS), metavar="N",
        help="number of parallel processes (default: as many as processors and free memory allow)",
    )  # fmt: skip


@contextmanager
def sharing(options: argparse.Namespace, frames: int, shot: Shot) -> Iterator[int]:
    """Yield the number of processes that share frames, this one included: as requested, or as fit and pay.

    With several, each has one thread.
    """
    pixels = shot.footage.width * shot.footage.height
    count = options.jobs or max(1, min(frames // jobs.LEAST_SHARE, jobs.fitting(pixels)))
    with limits.one_thread() if count > 1 else nullcontext():
        yield count
