"""A decoded frame of a video as players show it: cropped, upright, with square pixels."""

from __future__ import annotations

import struct
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from av.sidedata.sidedata import Type
from av.video.frame import VideoFrame
from av.video.stream import VideoStream
from numpy.typing import NDArray

from ..base.errors import UserError
from .colour_space import of_tags
from .picture_file import Pixels, squared

_LUMA = {
    1: (0.2126, 0.0722), 4: (0.30, 0.11), 5: (0.299, 0.114), 6: (0.299, 0.114), 7: (0.212, 0.087),
    9: (0.2627, 0.0593),
}  # fmt: skip
"""Weights of red and blue in luma by the code of matrix coefficients (ITU-T H.273, table 4)."""
_OTHERS = {8, *range(10, 18)}
"""Codes that are not read: YCgCo, constant luminance, ICtCp and others."""
_HD_ROWS = 720
"""Rows of stored pictures, before they are turned, from which untagged colours are BT.709's."""
_FULL = 2
"""FFmpeg's code of a range that uses all values."""


class BlenderView(StrEnum):
    """How a video that is read by Blender differs from `upright`, measured with bpy 5.2."""

    SAME = ""
    FLIP_X = "flip_x"
    """It is mirrored: Blender applies only the rotation of a display matrix."""
    FLIP_Y = "flip_y"
    CROPPED = "cropped"
    """It has the rows and columns that the container hides."""
    TRACK = "track"
    """It is the first video track, and `container.open_video` takes another one."""


class FirstFrame(NamedTuple):
    """Properties of a video from its first frame; the fields are those of `VideoInfo`."""

    width: int
    height: int
    colour_space: str
    view: BlenderView
    lacks_alpha: bool
    """True if the file has transparency that is not decoded."""

    @classmethod
    def of(cls, frame: VideoFrame, stream: VideoStream, pixel_aspect: float = 0.0) -> FirstFrame:
        """Describe a decoded frame of a stream; `pixel_aspect` as of `upright`."""
        height, width = upright(frame, stream, pixel_aspect).shape[:2]
        # For WebM: FFmpeg's own decoders of VP8 and VP9 leave alpha out.
        lacks_alpha = stream.metadata.get("alpha_mode") == "1" and not has_alpha(frame, stream)
        space = of_tags(frame.color_trc, frame.color_primaries)
        return cls(width, height, space, blender_view(frame, stream), lacks_alpha)


def upright(frame: VideoFrame, stream: VideoStream, pixel_aspect: float = 0.0) -> Pixels:
    """Convert a decoded frame of a stream to the picture that players show.

    `pixel_aspect` is the width of a stored pixel by its height, 0 for that of the file.

    Returns:
        (H, W, 3) RGB, or (H, W, 4) with straight alpha, of square pixels: uint8, or uint16 over its whole
        range where the frame has more than 8 bits.
    """
    if not frame.format.is_rgb and len(frame.format.components) > 2:
        frame.colorspace = _matrix(frame, stream)
    picture = _rgb(frame, has_alpha(frame, stream))
    top, bottom, left, right = cropping(stream)
    if top + bottom < frame.height and left + right < frame.width:
        picture = picture[top : frame.height - bottom, left : frame.width - right]  # type: ignore[assignment]
    if _is_mirrored(frame):
        # A display matrix that mirrors is its rotation after turning the picture upside down.
        picture = picture[::-1]  # type: ignore[assignment]
    turns = _turns(frame)
    picture = np.ascontiguousarray(np.rot90(picture, turns))  # type: ignore[assignment]
    ratio = stream.sample_aspect_ratio
    aspect = pixel_aspect or (float(ratio) if ratio and ratio > 0 else 1.0)
    return squared(picture, aspect, on_its_side=turns % 2 == 1)


def cropping(stream: VideoStream) -> tuple[int, int, int, int]:
    """Return the pixels at top, bottom, left and right that a container crops.

    QuickTime's clean aperture, Matroska's PixelCrop.
    """
    data = stream.codec_context.coded_side_data.get("frame_cropping", b"")
    return struct.unpack("<4I", data) if len(data) == 16 else (0, 0, 0, 0)


def has_alpha(frame: VideoFrame, stream: VideoStream) -> bool:
    """Return whether a frame has transparency. The fourth byte of uncompressed RGB in AVI is padding."""
    is_padding = stream.codec_context.name == "rawvideo" and stream.container.format.name == "avi"
    return any(component.is_alpha for component in frame.format.components) and not is_padding


def blender_view(frame: VideoFrame, stream: VideoStream) -> BlenderView:
    """Return the difference of Blender's picture of a frame from `upright`."""
    if stream.index != stream.container.streams.video[0].index:
        return BlenderView.TRACK
    if any(cropping(stream)):
        return BlenderView.CROPPED
    if not _is_mirrored(frame):
        return BlenderView.SAME
    return BlenderView.FLIP_X if _turns(frame) % 2 else BlenderView.FLIP_Y


def _turns(frame: VideoFrame) -> int:
    """Quarter turns to the left of a frame's display matrix, without its mirroring."""
    return round(frame.rotation / 90) % 4


def _is_mirrored(frame: VideoFrame) -> bool:
    """Return whether the display matrix of a frame mirrors: its 2x2 part has a negative determinant."""
    if Type.DISPLAYMATRIX not in frame.side_data:
        return False
    a, b, _, c, d, *_ = struct.unpack("<9i", bytes(frame.side_data[Type.DISPLAYMATRIX]))
    return bool(a * d - b * c < 0)


def _matrix(frame: VideoFrame, stream: VideoStream) -> int:
    """Code of a frame's matrix coefficients, by its tag, or by its size as players take them."""
    if frame.colorspace in _OTHERS:
        raise UserError(
            f"{Path(stream.container.name).name} has matrix coefficients {int(frame.colorspace)} (ITU-T"
            " H.273), which are not read; convert it to BT.709"
        )
    return frame.colorspace if frame.colorspace in _LUMA else 1 if frame.height >= _HD_ROWS else 5


def _rgb(frame: VideoFrame, alpha: bool) -> Pixels:
    """(H, W, 3 or 4) of a decoded frame, of known matrix coefficients, as it is stored."""
    if any(component.bits > 8 for component in frame.format.components):
        return _deep_rgb(frame, alpha)
    # Bicubic, also for the planes of colour, as in OpenCV and FFmpeg's own program.
    return np.asarray(
        frame.to_ndarray(format="rgba" if alpha else "rgb24", interpolation="BICUBIC", threads=1), np.uint8
    )


def _deep_rgb(frame: VideoFrame, alpha: bool) -> NDArray[np.uint16]:
    """(H, W, 3 or 4) uint16 of a frame of more than 8 bits; FFmpeg's own leaves white at 65283."""
    if frame.format.is_rgb or len(frame.format.components) < 3:
        name = "rgba64le" if alpha else "rgb48le"
        return np.asarray(frame.to_ndarray(format=name, interpolation="BICUBIC", threads=1), np.uint16)
    name = "yuva444p16le" if alpha else "yuv444p16le"
    planes = frame.to_ndarray(format=name, interpolation="BICUBIC", threads=1)
    red, blue = _LUMA[frame.colorspace]
    green = 1 - red - blue
    # Limited ranges are 219 and 224 of 256 (ITU-T H.273, 8.3). A full one FFmpeg spreads over all 16 bits in
    # luma, and moves up in the others, as seen in its result for known values.
    chroma = 65536 - (1 << (16 - frame.format.components[1].bits))
    full = frame.color_range == _FULL
    scale = np.array([65535, chroma, chroma] if full else [219 << 8, 224 << 8, 224 << 8], np.float64)
    matrix = np.array([
        [1, 0, 2 - 2 * red],
        [1, -blue * (2 - 2 * blue) / green, -red * (2 - 2 * red) / green],
        [1, 2 - 2 * blue, 0],
    ]) * (65535 / scale)  # fmt: skip
    offset = -matrix @ np.array([0 if full else 4096, 32768, 32768])
    yuv = np.ascontiguousarray(planes[..., :3], np.float32)
    rgb = cv2.transform(yuv, np.column_stack([matrix, offset]).astype(np.float32))
    colour = np.asarray(np.clip(rgb, 0, 65535) + 0.5, np.uint16)
    return np.dstack([colour, planes[..., 3]]) if alpha else colour
