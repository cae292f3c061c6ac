"""Memory that a render takes at its peak: `python -m benchmarks.timings.memory_peaks`.

Frames of the torture's clip, as large as asked, through the command line with a limit of the address space
that it never meets: the program then keeps to one arena of the C library, as under any such limit. Drawing
is Mesa's software OpenGL's here; the drivers of real cards map more.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from addon.core.camera.reconstruction import Intrinsics

from ..torture import clip
from ..torture.bench import HEADLESS, memory_limit

SIZES = ((96, 54), (1920, 1080), (3840, 2160), (7680, 4320))
METHODS = ("features", "layers")
UNMET = 256 * 2**30
"""Bytes of the limit."""
STEP = 0.01
"""Seconds between two looks at a process."""
MB = 2**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--widths", type=int, nargs="+", default=[width for width, _ in SIZES])
    parser.add_argument("--methods", nargs="+", default=METHODS)
    options = parser.parse_args()
    print("| size | method | address space, MiB | memory of its own, MiB | s |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for width, height in (size for size in SIZES if size[0] in options.widths):
            camera = Intrinsics(width, height, 0.85 * width, 0.85 * width, width / 2, height / 2)
            folder = Path(name) / f"{width}"
            work = clip.solve(clip.write_pictures(folder / "clip", 3, camera), folder / "work", camera)
            for method in options.methods:
                words = ["render", work, "--focus-distance", "7", "--blur", "0.05", "--views", "4"]
                words += ["--method", method, "--frames", "1-2", "--out", folder / method / "####.png"]
                began = time.perf_counter()
                mapped, own = peaks([sys.executable, str(HEADLESS), *map(str, words)])
                seconds = time.perf_counter() - began
                row = f"| {width}x{height} | {method} | {mapped / MB:.0f} | {own / MB:.0f} | {seconds:.0f} |"
                print(row, flush=True)


def peaks(command: list[str]) -> tuple[int, int]:
    """Bytes of address space and of memory that is no file's, which a process had at its peak.

    RuntimeError with what it said where it fails.
    """
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, preexec_fn=memory_limit(UNMET)
    )
    mapped = own = 0
    while process.poll() is None:
        status = Path(f"/proc/{process.pid}/status").read_text()
        # The threads of one that ends have none any more.
        if "VmPeak" in status:
            mapped, own = max(mapped, _bytes(status, "VmPeak")), max(own, _bytes(status, "RssAnon"))
        time.sleep(STEP)
    if process.returncode:
        raise RuntimeError(process.communicate()[0])
    return mapped, own


def _bytes(status: str, name: str) -> int:
    found = re.search(rf"^{name}:\s+(\d+) kB", status, re.MULTILINE)
    return 1024 * int(found[1]) if found else 0


if __name__ == "__main__":
    main()
