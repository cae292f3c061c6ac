"""What the highlights of a night street cost: `python -m benchmarks.timings.night_lamps`.

The street of `benchmarks.night_street` at 1280x720, about 1,200 clipped blobs a frame: to tell their radiance
from one frame, to find what clipping took from a frame with what others tell, and to read that where it is
kept.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from addon.core.depth.depth_store import DepthStore
from addon.core.frame.highlights import RESTORED
from addon.core.media.clip import to_linear
from addon.core.warp.clipped_blobs import clipped_blobs
from addon.core.warp.highlights import lamps

from ..cost import measured
from ..night_street import NightStreet


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lights", type=int, default=NightStreet.lights)
    street = replace(NightStreet(), lights=parser.parse_args().lights)
    frame, read = street.count // 2, lru_cache(maxsize=street.count)(street.read)
    for number in range(1, street.count + 1):
        read(number)
    picture = to_linear(read(frame))
    blobs, searched = measured(lambda: clipped_blobs(picture, RESTORED.threshold))
    _, told = measured(lambda: lamps(blobs))
    print(f"{len(blobs)} lamps of {np.median(blobs.area):.0f} pixels\n| step | CPU s |\n|---|---|")
    print(f"| blobs of a frame | {searched.cpu_s:.3f} |\n| their radiance | {told.cpu_s:.3f} |")
    with tempfile.TemporaryDirectory() as folder:
        pictures = []
        for step in ("a frame and those around", "the same, kept"):
            store = DepthStore(Path(folder), lambda: "street")
            clip = replace(street.context, read=read, highlight_store=store)
            found, cost = measured(lambda clip=clip: clip.picture(frame, RESTORED))  # type: ignore[misc]
            pictures.append(found)
            print(f"| {step} | {cost.cpu_s:.3f} |")
        assert np.array_equal(*pictures)
        for kind, what in (("lost", "light that a frame lost"), ("lamps", "what a source frame tells")):
            sizes = [path.stat().st_size for path in Path(folder).rglob(f"{kind}-*")]
            print(f"{what}: {np.mean(sizes) / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
