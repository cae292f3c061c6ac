"""A salient-object network of the user's own, which cuts the most striking object out of a crop."""

from pathlib import Path

import cv2
import numpy as np

from ..base.arrays import Bytes, Map
from ..base.errors import UserError
from ..media.onnx_network import IMAGENET, Normal, PictureNetwork

ISNET = Normal(0.5, 1.0)
"""IS-Net's pictures (Qin et al., "Highly accurate dichotomous image segmentation", 2022)."""
SIDES = {0: ISNET, 1024: ISNET, 320: IMAGENET}
"""Normalisation by the side that a file asks for, 0 for any: IS-Net's, and U2-Net's (Qin et al., 2020)."""
SIDE, STEP = 640, 64
"""Pixels of the crop of a file that takes any size, and those that its side is a multiple of. One look at 12
clips with drawn masks has a mean IoU of 0.846 at 512, 0.878 at 640 and 0.885 at 1024, for 0.8, 1.2 and 3.1 s
of processor time."""
FOUND, LEFT = 0.9, 0.1
"""Probability within a disc on a plain ground, at least, and on the ground, at most, in the test picture."""
FILLED, CLEAR = 0.005, 0.3
"""Shares of a picture, and of its pixels over `LEFT` those over `FOUND`, from which on it has a subject: that
of 30 of 46 clips in half of the frames; of three it was a wrong one, five with a subject had none."""


class Segmenter:
    """A salient-object network that is ready to run."""

    def __init__(self, path: Path) -> None:
        """Load it; raises UserError for a file that OpenCV cannot read or that is another kind of network."""
        try:
            self._network = PictureNetwork(path, _normal, ((SIDE, STEP),), square=True)
        except UserError as error:
            raise UserError(f"segmenter: {error}") from None

    def check(self) -> None:
        """Try it on a test picture; raises UserError if it does not find the object there."""
        picture = np.full((256, 256, 3), 170, np.uint8)
        cv2.circle(picture, (128, 128), 60, (190, 40, 30), -1, cv2.LINE_AA)
        found = self.probability(picture)
        if found[128, 128] < FOUND or found[:8, :8].mean() > LEFT:
            raise UserError(
                f"segmenter: {self._network.name} does not find the disc of a test picture, as IS-Net and"
                " U2-Net do"
            )

    def probability(self, crop: Bytes) -> Map:
        """Return the probability (h, w) of pixels to be of the most striking object in a crop of a picture.

        Args:
            crop: (h, w, 3) uint8 RGB, display-encoded.

        Raises:
            UserError: OpenCV cannot run the network.
        """
        try:
            found = np.asarray(self._network.run(crop), np.float32)
        except ValueError as error:
            raise UserError(f"segmenter: {self._network.name} cannot be used: {error}") from None
        whole = cv2.resize(np.clip(found, 0, 1), crop.shape[1::-1], interpolation=cv2.INTER_LINEAR)
        return np.asarray(whole, np.float32)


def stands_out(probability: Map) -> bool:
    """Return whether a picture has a subject, by the probability (h, w) of its most striking object."""
    sure, possible = (np.count_nonzero(probability > each) for each in (FOUND, LEFT))
    return bool((probability > 0.5).mean() > FILLED and sure >= CLEAR * possible)


def _normal(sides: tuple[int, ...]) -> Normal:
    if len(set(sides)) == 1 and sides[0] in SIDES:
        return SIDES[sides[0]]
    raise ValueError(
        f"its input has {' x '.join(map(str, sides))} pixels; IS-Net (1024 x 1024, or any size) and U2-Net"
        " (320 x 320) are known"
    )
