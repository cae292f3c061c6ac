"""Frames as the clip of a camera or a phone has them: H.264, and read as the product reads it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import av
import numpy as np
from numpy.typing import NDArray

CRF = 20
"""x264's rate factor: 7 Mbit/s at 1280x720, about what phones record."""


def encode(frames: Iterable[NDArray[np.uint8]], path: Path, crf: int = CRF, fps: int = 24) -> Path:
    """Write frames (H, W, 3), sRGB, of one size with even sides, as an H.264 file; returns its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"part-{path.name}")
    with av.open(str(part), "w") as file:
        stream = None
        for pixels in frames:
            if stream is None:
                stream = file.add_stream("libx264", rate=fps, options={"crf": str(crf)})
                stream.height, stream.width = pixels.shape[:2]
                stream.pix_fmt = "yuv420p"
                # BT.709, as cameras say it.
                context = stream.codec_context
                context.colorspace = context.color_primaries = context.color_trc = 1
                context.color_range = 1
            picture = av.VideoFrame.from_ndarray(pixels, "rgb24")
            file.mux(stream.encode(picture.reformat(format="yuv420p", dst_colorspace=1, dst_color_range=1)))
        assert stream is not None
        file.mux(stream.encode())
    part.rename(path)
    return path
