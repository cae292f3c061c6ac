"""How many feature points a frame has (the thesis's section 4.3), as histograms."""

from __future__ import annotations

from pathlib import Path

import cv2
import matplotlib
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Plot
from numpy.typing import NDArray

from addon.core.base.arrays import Ints
from addon.core.media.clip import Footage, open_footage

from .clips import Clip
from .front_ends import FRONTS, LIFE, registered
from .marks import Figure

matplotlib.use("Agg")

DPI = 100
BINS = 30


def rasterised(plot: Plot) -> NDArray[np.uint8]:
    """(H, W, 3) of a plot, which is closed."""
    plot.canvas.draw()
    drawn = np.asarray(plot.canvas.buffer_rgba())[..., :3].copy()  # type: ignore[attr-defined]
    plt.close(plot)
    return drawn


def counts(clip: Clip, answers: str, small: int = 0) -> Figure:
    """Histograms of the features that each front end registers; once more on the clip `small` pixels wide."""
    clips = [clip.footage, *([shrunk(clip, small)] if small else [])]
    plot, rows = plt.subplots(
        len(clips),
        len(FRONTS),
        figsize=(9, 0.5 + 2.4 * len(clips)),
        dpi=1.5 * DPI,
        sharey="row",
        squeeze=False,
    )
    said = []
    for footage, axes in zip(clips, rows, strict=True):
        size = f"{footage.width}x{footage.height}"
        found = {name: registered(front(footage)) for name, front in FRONTS.items()}
        top = 1.05 * max(int(number.max()) for number in found.values())
        for axis, (name, number) in zip(axes, found.items(), strict=True):
            histogram(axis, f"{name}\n{size}", number, top)
        said.append(f"{size}: " + "; ".join(f"{name} {_spread(number)}" for name, number in found.items()))
        axes[0].set_ylabel("frames")
    for axis in rows[-1]:
        axis.set_xlabel("registered feature points")
    plot.suptitle(
        f"{clip.name}: frames with x registered feature points, of {len(clip.footage.frames)} frames"
    )
    plot.tight_layout()
    solved = np.array([len(image.points) for image in clip.reconstruction.images], np.int32)
    return Figure(
        f"feature_counts_{clip.name}.png", rasterised(plot),
        "How many frames register how many feature points, for the thesis's three front ends and ours;"
        f" registered are all tracks alive in a frame that live for at least {LIFE} frames.",
        answers,
        "Mean (least to most; frames without any) " + ". ".join(said)
        + f". Of ours {_spread(solved)} a frame have a 3D point after the solve.",
    )  # fmt: skip


def histogram(axis: Axes, title: str, number: Ints, top: float) -> None:
    """How many frames have how many features, (F,), up to `top`; the orange line is the mean."""
    axis.hist(number, bins=np.linspace(0, top, BINS + 1).tolist(), color="#0072B2", edgecolor="white")
    axis.axvline(float(number.mean()), color="#D55E00", linewidth=1.5)
    empty = int((number == 0).sum())
    none = f"\nnone in {empty} frames" if empty else ""
    axis.set_title(f"{title}\nmean {number.mean():.0f}, least {number.min()}{none}", fontsize=9)
    axis.locator_params(axis="x", nbins=4)


def _spread(number: Ints) -> str:
    return f"{number.mean():.0f} ({number.min()} to {number.max()}; {(number == 0).sum()})"


def shrunk(clip: Clip, width: int) -> Footage:
    """The clip at another width, on disk."""
    folder: Path = clip.folder / f"clip-{width}"
    folder.mkdir(parents=True, exist_ok=True)
    source = clip.footage
    for frame in source.frames:
        path = folder / f"frame_{frame:04d}.png"
        if not path.exists():
            size = (width, round(source.height * width / source.width))
            small = cv2.resize(source.read(frame)[..., ::-1], size, interpolation=cv2.INTER_AREA)
            cv2.imwrite(str(path), small)
    return open_footage(folder)
