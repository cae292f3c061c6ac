"""Depth of a real room against a sensor's: `python -m benchmarks.special room` (real data).

Error of inverse depth in per cent of its range, mean and median over the pixels that the sensor knows, of the
clip's own stereo; of maps alone, which are the sensor's as a network would have them (`network_depth`), or as
they are; and of both together. The cameras are solved; the sensor's unit is brought to theirs by the feature
points, so what is wrong there counts as well.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import cv2
import numpy as np

from addon.core.base.nearest_fill import nearest
from addon.core.depth.source import NO_PICTURE, DepthSource
from addon.core.depth.stereo_depth import StereoDepth
from addon.core.depth.user_depth import UserDepth
from addon.core.depth.user_maps import open_depth
from addon.core.frame.clip_context import ClipContext
from addon.core.media.clip import Footage, open_footage
from addon.core.sfm.process import SolveProcess
from addon.core.sfm.workspace import load_solve

from .. import store
from .network_depth import as_seen
from .scenes import Floats

DATA = Path(os.environ.get("VA_DATA", store.ROOT.parent / "shared" / "data")) / "room"
STEP = 11
"""Frames from one that is judged to the next."""


def main() -> None:
    if not DATA.is_dir():
        raise SystemExit(f"{DATA} is missing (set VA_DATA to the folder that holds the test data)")
    footage = open_footage(DATA / "images")
    with tempfile.TemporaryDirectory() as folder:
        SolveProcess(
            footage.path, Path(folder) / "work", focal=float(np.loadtxt(DATA / "K.txt")[0, 0])
        ).wait()
        reconstruction = load_solve(Path(folder) / "work").reconstruction
        sensor = UserDepth.of(open_depth(DATA / "depth", footage), reconstruction)
        network = UserDepth.of(open_depth(_as_network(footage, Path(folder)), footage), reconstruction)
        clip = ClipContext(reconstruction, footage.read)
        sources: dict[str, DepthSource] = {
            "stereo": StereoDepth(clip.stereo), "network": network,
            "stereo and network": StereoDepth(clip.stereo, maps=network),
            "stereo and sensor": StereoDepth(clip.stereo, maps=sensor),
        }  # fmt: skip
        errors: dict[str, list[Floats]] = {name: [] for name in sources}
        for frame in footage.frames[4::STEP]:
            pinhole = clip.stereo.canvas(frame).pinhole
            size = pinhole.width, pinhole.height
            known = cv2.resize(_metres(frame), size, interpolation=cv2.INTER_NEAREST) > 0
            true = _inverse(sensor, clip, frame)[known]
            span = np.ptp(np.percentile(true, [1, 99]))
            for name, source in sources.items():
                off = 100 * np.abs(_inverse(source, clip, frame)[known] - true) / span
                errors[name].append(np.array([off.mean(), np.median(off)]))
    print("| depth of | mean, % | median, % |\n|---|---|---|")
    for name, each in errors.items():
        mean, median = np.mean(each, axis=0)
        print(f"| {name} | {mean:.2f} | {median:.2f} |")


def _inverse(source: DepthSource, clip: ClipContext, frame: int) -> Floats:
    found = source.at(frame, clip.stereo.canvas(frame), NO_PICTURE)
    assert found is not None
    return found.inverse_depth


def _metres(frame: int) -> Floats:
    """(h, w) of the sensor, 0 where it knows nothing."""
    stored = cv2.imread(str(DATA / "depth" / f"{frame:05d}.png"), cv2.IMREAD_UNCHANGED)
    assert stored is not None
    return np.asarray(stored, np.float64) / 1000


def _as_network(footage: Footage, folder: Path) -> Path:
    """A folder of the sensor's maps as a network has them, holes like what is nearest."""
    maps = folder / "network"
    maps.mkdir()
    for frame in footage.frames:
        metres = _metres(frame)
        known = metres > 0
        inverse = nearest(np.where(known, 1 / np.where(known, metres, 1), 0.0), known)
        np.savez(maps / f"depth_{frame:05d}.npz", depth=as_seen(inverse, frame))
    return maps


if __name__ == "__main__":
    main()
