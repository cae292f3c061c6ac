"""Video for the extension's page in a store: the window at work, then the movie that it renders.

    python -m sample_scenes.store_video [--screens build/window/pictures] [--out docs/store/video.mp4]

The window is that of the screenshots by `make pictures`. The movie is the sample clip, rendered with its
focus pulled by the command line, as in `make moving-picture`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import cv2
import numpy as np
from av.video.reformatter import ColorPrimaries, ColorRange, Colorspace, ColorTrc

from .demo import ROOT, DemoError, Frames, read_clip, run_product
from .moving_picture import BLUR, FOCUS

WIDTH, HEIGHT, RATE = 1920, 1080, 24
COLUMN = 480
"""Pixels across of the captions; the rest shows a screenshot, or the movie."""
PART = slice(0, 990), slice(0, 1320)
"""Rows and columns of a screenshot, without the editors on its right; 4:3 as its place in the video."""
FADE = 6
"""Frames in which one scene turns into the next."""
GROUND, DIM, BRIGHT = (34, 32, 30), (120, 115, 110), (240, 240, 240)
"""Colours, blue first, of the ground, of captions, and of the present one."""
RATE_FACTOR = "20"
"""H.264's quality: texts of the window are as sharp as in the screenshots. Chosen by inspection."""
HEAVIEST = 5_000_000
"""Bytes of the video."""


@dataclass(frozen=True)
class Scene:
    """Part of the video with one caption."""

    caption: str
    pictures: Sequence[np.ndarray]
    """Pictures (H, W, 3), blue first, shown one after the other, each equally long."""
    seconds: float
    rest: float = 0.0
    """Seconds for which the last picture stays."""

    def frames(self) -> Iterator[np.ndarray]:
        """Yield the picture of each frame of the video."""
        count = round(self.seconds * RATE)
        for number in range(count):
            yield self.pictures[number * len(self.pictures) // count]
        for _ in range(round(self.rest * RATE)):
            yield self.pictures[-1]


STEPS = (
    ("drop", "Drop a clip on the viewport", 2.4),
    ("solving", "The camera is solved", 1.8),
    ("solved", "Look through the camera", 2.0),
    ("preview", "Preview the depth of field", 2.2),
    ("pick", "Pick what is in focus", 2.0),
    ("marks", "Pick again at another frame", 2.2),
)
"""Screenshots in the order of the work, their captions, and seconds."""


def scenes(screens: Path, source: Frames, result: Frames) -> list[Scene]:
    """Return the parts of the video, about 20 seconds.

    Args:
        screens: Folder of the screenshots.
        source: The clip (N, H, W, 3), blue first.
        result: The clip with its focus pulled (N, H, W, 3), blue first.

    Raises:
        DemoError: A screenshot is missing.
    """
    pull = [_window(file) for file in sorted(screens.glob("scrub_*.png"))]
    if not pull:
        raise DemoError(f"{screens} has no screenshots of a pull; call make pictures.")
    work = [Scene(caption, [_window(screens / f"{name}.png")], time) for name, caption, time in STEPS]
    return [
        *work,
        Scene("The focus is pulled", pull, 2.0),
        Scene("The clip as filmed", [_movie(each) for each in source], 1.5),
        Scene("The rendered movie", [_movie(each) for each in result], 3.0, 0.9),
    ]


def _window(file: Path) -> np.ndarray:
    picture = cv2.imread(str(file))
    if picture is None:
        raise DemoError(f"{file} is missing; call make pictures.")
    size = WIDTH - COLUMN, HEIGHT
    return np.asarray(cv2.resize(picture[PART], size, interpolation=cv2.INTER_CUBIC), np.uint8)


def _movie(frame: np.ndarray) -> np.ndarray:
    """A frame of a clip in the middle of its place."""
    width = WIDTH - COLUMN
    height = round(width * frame.shape[0] / frame.shape[1])
    above = (HEIGHT - height) // 2
    shown = np.full((HEIGHT, width, 3), GROUND, np.uint8)
    shown[above : above + height] = cv2.resize(frame, (width, height), interpolation=cv2.INTER_CUBIC)
    return shown


def frames(parts: Sequence[Scene]) -> Iterator[np.ndarray]:
    """Yield all frames (H, W, 3) of the video, blue first."""
    before: np.ndarray | None = None
    for number, part in enumerate(parts):
        captions = _captions([each.caption for each in parts], number)
        for at, picture in enumerate(part.frames()):
            shown = picture
            if before is not None and at < FADE:
                share = (at + 1) / (FADE + 1)
                shown = cv2.addWeighted(picture, share, before, 1 - share, 0)
            yield np.hstack([captions, shown])
        before = picture


def _captions(texts: Sequence[str], present: int) -> np.ndarray:
    """The column (H, W, 3) with all captions, the present one bright."""
    column = np.full((HEIGHT, COLUMN, 3), GROUND, np.uint8)
    face = cv2.FontFace("sans")
    cv2.putText(column, "Virtual Aperture", (40, 130), BRIGHT, face, 48, 600)
    cv2.putText(column, "Depth of field for video", (40, 185), DIM, face, 30, 400)
    for number, text in enumerate(texts):
        is_present = number == present
        y = 320 + 75 * number
        if is_present:
            cv2.rectangle(column, (0, y - 36), (8, y + 14), (230, 150, 70), cv2.FILLED)
        cv2.putText(
            column, text, (40, y), BRIGHT if is_present else DIM, face, 29, 500 if is_present else 400
        )
    return column


def write_video(out: Path, pictures: Iterator[np.ndarray]) -> None:
    """Write frames (H, W, 3), blue first, as an H.264 video that browsers play."""
    with av.open(str(out), "w", options={"movflags": "+faststart"}) as container:
        stream = container.add_stream("libx264", RATE, options={"crf": RATE_FACTOR, "preset": "slow"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.codec_context.color_primaries = ColorPrimaries.BT709
        stream.codec_context.color_trc = ColorTrc.BT709
        stream.codec_context.colorspace = Colorspace.ITU709
        stream.codec_context.color_range = ColorRange.MPEG
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(picture, "bgr24")
            container.mux(stream.encode(frame.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709)))
        container.mux(stream.encode())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--screens", type=Path, default=ROOT / "build" / "window" / "pictures", metavar="DIR")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "store" / "video.mp4", metavar="FILE.mp4")
    parser.add_argument("--work-dir", type=Path, default=ROOT / "demo")
    arguments = parser.parse_args()
    out: Path = arguments.out
    clip, result = ROOT / "sample_scenes" / "desk.mp4", arguments.work_dir / "desk_focus_pull.mp4"
    try:
        arguments.work_dir.mkdir(parents=True, exist_ok=True)
        run_product(clip, result, arguments.work_dir / "desk.aperture", BLUR, FOCUS)
        parts = scenes(arguments.screens, read_clip(clip), read_clip(result))
    except DemoError as error:
        print(f"store video: {error}", file=sys.stderr)
        return 1
    out.parent.mkdir(parents=True, exist_ok=True)
    write_video(out, frames(parts))
    size = out.stat().st_size
    if size > HEAVIEST:
        print(f"store video: {size} bytes are more than {HEAVIEST}", file=sys.stderr)
        return 1
    print(f"{out} ({size / 1e6:.1f} MB)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
