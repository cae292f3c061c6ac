"""How far a picture is from the truth: the scores of section 7 of the design notes.

Pictures are (H, W, 3) float32 linear light. Every score is taken after clipping to 0..1 and sRGB encoding,
because that is what is looked at: an error in a highlight that is far over white is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import flip_evaluator  # type: ignore[import-untyped, unused-ignore]
import numpy as np
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from addon.core.media.light import encode_srgb

Picture = NDArray[np.float32]
Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

BAND = 15
"""Width in pixels of the band around depth jumps that has a score of its own."""
JUMP = 0.05
"""Share of the nearer side's inverse depth by which a depth jump departs from the slopes beside it."""
SHARP = 0.5
"""Blur disc diameter in pixels under which a pixel is in focus."""
SEEDS_GAIN = 6.0
"""dB by which the mean of two noisy truths is nearer to the noise-free one than they are to each other."""


def psnr(picture: Picture, truth: Picture, where: Mask | None = None) -> float:
    """Peak signal to noise ratio in dB over all channels of the pixels of `where`, (H, W) bool.

    Infinite where the two are equal, NaN where the mask has no pixel. Raises ValueError if the sizes differ.
    """
    squared = (_encoded(picture, truth) - _encoded(truth, truth)) ** 2
    if where is not None:
        squared = squared[where]
    if squared.size == 0:
        return float("nan")
    error = float(squared.mean())
    return float("inf") if error == 0 else float(-10 * np.log10(error))


def unbiased_psnr(picture: Picture, seeds: tuple[Picture, Picture], where: Mask | None = None) -> float:
    """`psnr` against the noise-free truth, of which two renders with independent noise are known.

    The mean product of the picture's differences from both has their noise in it only by chance, while a mean
    square would have it added. Infinite where nothing but noise is left, NaN where the mask has no pixel.
    """
    return psnr_of(unbiased_error(picture, seeds), where)


def unbiased_error(picture: Picture, seeds: tuple[Picture, Picture]) -> Floats:
    """(H, W, 3) squared error of each value for `psnr_of`, without the noise of two renders of the truth."""
    one, other = (_encoded(picture, seed) - _encoded(seed, seed) for seed in seeds)
    return one * other


def psnr_of(squared: Floats, where: Mask | None = None) -> float:
    """PSNR in dB of squared errors (H, W, 3), of the pixels of `where`, (H, W) bool."""
    squared = squared if where is None else squared[where]
    if squared.size == 0:
        return float("nan")
    error = float(squared.mean())
    return float("inf") if error <= 0 else float(-10 * np.log10(error))


def ssim(picture: Picture, truth: Picture) -> float:
    """Structural similarity in -1..1, the mean over the channels: Wang et al. 2004, equation 13.

    The paper's settings: an 11-pixel Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03. Raises ValueError
    if the sizes differ or a side is shorter than 11 pixels.
    """
    score = structural_similarity(  # type: ignore[no-untyped-call, unused-ignore]
        _encoded(truth, truth),
        _encoded(picture, truth),
        data_range=1.0,
        channel_axis=-1,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
    )
    return float(score)


def flip(picture: Picture, truth: Picture) -> float:
    """Mean LDR-FLIP in 0..1, 0 for equal: Andersson et al. 2020, at the paper's 67 pixels per degree.

    The evaluator is handed sRGB values and told so. Raises ValueError if the sizes differ.
    """
    reference, test = (np.ascontiguousarray(_encoded(p, truth), dtype=np.float32) for p in (truth, picture))
    _, mean, _ = flip_evaluator.evaluate(reference, test, "LDR", inputsRGB=True, applyMagma=False)
    return float(mean)


def edge_band(inverse_depth: Floats, width: float = BAND, jump: float = JUMP) -> Mask:
    """(H, W) bool: the pixels of a band `width` pixels wide around the jumps of a true inverse depth map.

    `inverse_depth` is (H, W), sharp (no pixel mixes two surfaces), 0 infinitely far. The band is centred on
    the silhouette's outermost pixel, the one on the nearer side; an odd `width` is met exactly.

    A plane's inverse depth is affine in the picture, so the step between two neighbours is not a jump in
    itself: it is one if it lies outside the range of the two slopes found two pixels to its left and right.
    A floor's steps are all alike, however grazing; at a crease they pass from one plane's to the other's.
    The step must be off by more than `jump` of the nearer pixel's inverse depth, as between two walls of
    which one is 5 % farther away.
    """
    across = _jumps(inverse_depth, jump)
    down = _jumps(inverse_depth.T, jump).T
    far_from = np.where(across | down, np.uint8(0), np.uint8(1))
    if far_from.all():
        return np.zeros(inverse_depth.shape, dtype=bool)
    distance = cv2.distanceTransform(far_from, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.asarray(distance < width / 2)


def unclipped(frame: NDArray[np.uint8], disc: Floats) -> Mask:
    """(H, W) bool: the pixels that no clipped pixel of the frame, (H, W, 3) sRGB, can reach by its blur disc.

    A highlight that the camera recorded as 255 was brighter by an unknown factor, and no renderer of that
    frame can give its disc the right brightness. `disc` is (H, W), diameters in pixels.
    """
    clipped = (frame == 255).any(axis=-1)
    count, label, boxes, _ = cv2.connectedComponentsWithStats(clipped.astype(np.uint8))
    reached = clipped.copy()
    # One highlight has one depth, so its pixels' largest disc goes for all of them.
    for highlight in range(1, count):
        left, top, width, height = (int(side) for side in boxes[highlight, :4])
        inside = np.s_[top : top + height, left : left + width]
        own = label[inside] == highlight
        radius = int(np.ceil(np.abs(disc[inside][own]).max() / 2)) + 1
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
        wide = cv2.dilate(np.pad(own, radius).astype(np.uint8), kernel) > 0
        first = max(top - radius, 0), max(left - radius, 0)
        target = reached[first[0] : top + height + radius, first[1] : left + width + radius]
        skipped = first[0] - (top - radius), first[1] - (left - radius)
        target |= wide[skipped[0] :, skipped[1] :][: target.shape[0], : target.shape[1]]
    return np.asarray(~reached)


def in_focus(disc: Floats) -> Mask:
    """(H, W) bool where the signed blur disc diameter, (H, W) in pixels, is under half a pixel."""
    return np.abs(disc) < SHARP


def rm(pictures: Sequence[Picture], truths: Sequence[Picture], where: Sequence[Mask] | None = None) -> float:
    """Temporal error of a clip without motion: mean |(P[t+1] - P[t]) - (G[t+1] - G[t])| of encoded values.

    A steady error costs nothing, flicker costs its height. With `where`, (H, W) bool for each frame, pixels
    count that are in that of either frame. NaN for fewer than two frames, or where nothing counts; raises
    ValueError if the clips differ in length or size.
    """
    errors = _errors(pictures, truths)
    masks = where or [np.ones(error.shape[:2], bool) for error in errors]
    changes = [
        np.abs(after - before)[one | other].mean()
        for (before, after), (one, other) in zip(pairwise(errors), pairwise(masks), strict=True)
        if (one | other).any()
    ]
    return float(np.mean(changes)) if changes else float("nan")


def warped_error(
    pictures: Sequence[Picture],
    truths: Sequence[Picture],
    motions: Sequence[Floats],
    valid: Sequence[Mask],
) -> float:
    """Temporal error of a clip along the true motion: an error that sticks to the scene costs nothing.

    With the encoded error E = P - G, the mean of |E[t+1] at x + motions[t](x) - E[t](x)| over all pixels of
    `valid[t]` and all t. motions[t], (H, W, 2) in pixels right and down, leads from a pixel of frame t to
    where its surface is in frame t + 1; valid[t], (H, W) bool, says where that surface is seen in both.
    E[t+1] is read bilinearly; what moves out of the picture is not counted.

    NaN where no pixel is valid; raises ValueError if the lists do not fit each other.
    """
    errors = _errors(pictures, truths)
    if not len(motions) == len(valid) == max(len(errors) - 1, 0):
        raise ValueError(f"{len(errors)} frames need {max(len(errors) - 1, 0)} motions, got {len(motions)}")
    total, count = 0.0, 0
    for (before, after), motion, seen in zip(pairwise(errors), motions, valid, strict=False):
        height, width = seen.shape
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        to = np.stack([x, y], axis=2) + motion
        counted = seen & np.all((to >= 0) & (to <= (width - 1, height - 1)), axis=2)
        moved = cv2.remap(after, to.astype(np.float32), None, cv2.INTER_LINEAR)
        change = np.abs(moved - before)[counted]
        total, count = total + float(change.sum()), count + change.size
    return total / count if count else float("nan")


def noise_ceiling(one_seed: Picture, other_seed: Picture) -> float:
    """PSNR in dB of one seed's truth against the other's: how noisy the truth is.

    The truth in use is the mean of both. With independent noise of variance v in each, the two differ by
    2 v and their mean is v / 2 from the noise-free picture: a factor of 4, or 6 dB, better than this.
    """
    return psnr(one_seed, other_seed)


def within_noise(score: float, ceiling: float) -> bool:
    """Whether a PSNR is less than 6 dB under the ceiling of its truth, so that noise has a part in it."""
    return score > ceiling - SEEDS_GAIN


def _encoded(picture: Picture, like: Picture) -> Floats:
    if picture.shape != like.shape:
        raise ValueError(f"the picture is {picture.shape}, its truth {like.shape}")
    return np.asarray(encode_srgb(np.clip(picture.astype(np.float64), 0, 1)))


def _errors(pictures: Sequence[Picture], truths: Sequence[Picture]) -> list[Picture]:
    """Encoded picture minus encoded truth of each frame."""
    pairs = zip(pictures, truths, strict=True)
    return [(_encoded(p, g) - _encoded(g, g)).astype(np.float32) for p, g in pairs]


def _jumps(inverse_depth: Floats, share: float) -> Mask:
    """(H, W) bool: pixels on the nearer side of a jump to their left or right neighbour."""
    steps = np.diff(inverse_depth, axis=1)
    # Two pixels on, so that the step's own two pixels have no part in the slope beside it.
    beside = np.pad(steps, ((0, 0), (2, 2)), constant_values=np.nan)
    left, right = beside[:, :-4], beside[:, 4:]
    # The border has a slope on one side only: fmin passes over NaN.
    excess = np.maximum(steps - np.fmax(left, right), np.fmin(left, right) - steps)
    nearer = np.maximum(inverse_depth[:, 1:], inverse_depth[:, :-1])
    is_jump = excess > share * nearer
    jumps = np.zeros(inverse_depth.shape, dtype=bool)
    jumps[:, 1:] |= is_jump & (steps > 0)
    jumps[:, :-1] |= is_jump & (steps < 0)
    return jumps
