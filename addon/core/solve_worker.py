"""The solving worker: `python -m addon.core.solve_worker JOB.json`, one JSON object a line on its output.

`{"stage": ..., "done": ..., "total": ...}` while it works, then `{"ok": true}`, or `{"error": ...}`.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import threading
import time
import traceback
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from . import footage as footage_module
from .colmap_model import write_model
from .errors import UserError
from .footage import open_footage
from .tracks import track_features


def main(job_path: str) -> int:
    """Solve the job's clip into its folder; 0, or 1 after saying what went wrong."""
    job = json.loads(Path(job_path).read_text(encoding="utf-8"))
    threading.Thread(target=_end_with_parent, args=(Path(job["folder"]),), daemon=True).start()
    try:
        _solve(job)
    except UserError as error:
        _say({"error": str(error)})
        return 1
    except Exception as error:  # the parent shows it: a worker must never die silently
        _say(
            {"error": f"solving failed: {type(error).__name__}: {error}", "traceback": traceback.format_exc()}
        )
        return 1
    _say({"ok": True})
    return 0


def _solve(job: dict[str, object]) -> None:
    began = time.monotonic()
    # After cv2 has been imported, and with pycolmap's own handler for SIGTERM, which can hang, taken out.
    from . import mapping

    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    footage_module.exr_decoder = _exr
    folder = Path(str(job["folder"]))
    frames = job["frames"]
    assert isinstance(frames, list)
    footage = open_footage(str(job["footage"]), frames)
    tracks = track_features(footage, _progress)
    focal = job["focal"]
    mapped = mapping.reconstruct(tracks, float(str(focal)) if focal else None, _progress)
    result = mapped.reconstruction
    (folder / "model").mkdir()
    write_model(folder / "model", result)
    seen = [len(image.points) for image in result.images]
    report = {
        "frames": len(footage.frames),
        "registered": len(result.images),
        "points": len(result.points),
        "points_per_frame": [int(min(seen)), int(np.median(seen)), int(max(seen))],
        "reprojection_error": float(result.points.error.mean()),
        "focal": result.cameras[0].fx,
        "focal_sigma": mapped.focal_sigma if np.isfinite(mapped.focal_sigma) else None,
        "focal_held": mapped.focal_held,
        "parallax": mapped.parallax,
        "triangulation_angle": mapped.angle,
        "size": [footage.width, footage.height],
        "fps": footage.fps,
        "versions": mapping.versions(),
        "seconds": round(time.monotonic() - began, 1),
    }
    (folder / "report.json").write_text(json.dumps(report), encoding="utf-8")


def _end_with_parent(folder: Path) -> None:
    # Standard input closes when whoever started us is gone; then nobody wants the result.
    os.read(0, 1)
    # The solve goes on beside us and may put a file into a folder that is being emptied.
    while folder.exists():
        shutil.rmtree(folder, ignore_errors=True)
    os._exit(1)


def _progress(stage: str, done: int, total: int) -> None:
    _say({"stage": stage, "done": done, "total": total})


def _say(message: dict[str, object]) -> None:
    try:
        print(json.dumps(message), flush=True)
    except BrokenPipeError:
        # Nobody listens any more: `_end_with_parent` is about to clean up and end the process.
        threading.Event().wait()


def _exr(path: Path) -> NDArray[np.float32]:
    # Eight bits are enough to follow features; the picture itself is read in Blender.
    import pycolmap

    bitmap = pycolmap.Bitmap.read(str(path), True)
    if bitmap is None:
        raise OSError(path)
    return (np.asarray(bitmap.to_array()) / 255).astype(np.float32)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
