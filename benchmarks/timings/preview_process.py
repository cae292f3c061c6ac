"""What a preview in another process would cost beside its pictures.

    python -m benchmarks.special preview_process [BLEND]

A picture of 960x540 goes through a mapped file: the other process writes it there and sends a line, this one
maps the file and copies the picture. Of each the median of many, in milliseconds. With a .blend that holds a
solved clip also the copy of the file that the other process would open, and what it takes from its start to
the clip's first frame.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

import addon
from addon.core.base.job import Job
from addon.core.base.messages import Progress
from addon.render.processes.launcher import write_blend

SIZE, PICTURES = (540, 960, 4), 50
KINDS = ("float32", "float16")
WRITER = """
import sys, time
import numpy as np
from addon.core.base.messages import Progress, Result, send, speak
speak()
rows, columns, channels, count = map(int, sys.argv[3:7])
picture = np.random.default_rng(0).random((rows, columns, channels)).astype(sys.argv[2])
for number in range(count):
    began = time.perf_counter()
    held = np.memmap(f"{sys.argv[1]}{number % 2}", picture.dtype, "r+", shape=picture.shape)
    held[:] = picture
    send(Progress(f"{time.perf_counter() - began}", number + 1, count))
    time.sleep(0.05)
send(Result())
"""
OPENER = """
import sys
import addon, bpy
addon.register()
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
from addon.scene.sources.shot import shot_of
shot = shot_of(bpy.context.scene)
shot.clip.read(shot.footage.frames[0])
"""
ENVIRONMENT = os.environ | {"PYTHONPATH": str(Path(addon.__file__).parents[1])}


def passed(folder: Path, kind: str) -> tuple[float, float, float]:
    """Median milliseconds in which a picture is written, and mapped and copied, and its megabytes."""
    nbytes = int(np.prod(SIZE)) * np.dtype(kind).itemsize
    for slot in range(2):
        (folder / str(slot)).write_bytes(bytes(nbytes))
    job = Job()
    sizes = [str(each) for each in (*SIZE, PICTURES)]
    job.start([sys.executable, "-c", WRITER, f"{folder}{os.sep}", kind, *sizes], environment=ENVIRONMENT)
    written, read = list[float](), list[float]()
    while job.is_running:
        for message in job.poll():
            if isinstance(message, Progress):
                began = time.perf_counter()
                picture = np.array(np.memmap(folder / str((message.done - 1) % 2), kind, "r", shape=SIZE))
                read.append(time.perf_counter() - began)
                written.append(float(message.stage))
                assert picture.any()
        time.sleep(0.001)
    assert job.failure is None and len(read) == PICTURES, job.failure
    return 1000 * float(np.median(written)), 1000 * float(np.median(read)), nbytes / 1e6


def main() -> None:
    """Print the costs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("blend", type=Path, nargs="?", help="a .blend with a solved clip")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print("| picture 960x540 | MB | written, ms | mapped and copied, ms |\n|---|---|---|---|")
        for kind in KINDS:
            written, read, size = passed(Path(folder), kind)
            print(f"| {kind} | {size:.1f} | {written:.1f} | {read:.1f} |", flush=True)
        if options.blend is not None:
            addon.register()
            bpy.ops.wm.open_mainfile(filepath=str(options.blend.resolve()))
            began = time.perf_counter()
            write_blend(Path(folder) / "copy.blend")
            print(f"copy of the file: {1000 * (time.perf_counter() - began):.0f} ms")
            began = time.perf_counter()
            subprocess.run(
                [sys.executable, "-c", OPENER, str(options.blend.resolve())],
                check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=ENVIRONMENT,
            )  # fmt: skip
            print(f"another process, to the clip's first frame: {time.perf_counter() - began:.1f} s")


if __name__ == "__main__":
    main()
