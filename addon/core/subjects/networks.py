"""Small networks that recognise people, faces and animals, run by OpenCV on the processor.

They are MediaPipe's (Bazarevsky et al., "BlazeFace", 2019; "BlazePose", 2020). The build fetches them into
`addon/networks` (`tools/networks.py`); an extension that was built without them recognises nobody.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Bytes, Floats, Map
from ..base.errors import UserError
from ..base.side_by_side import Lock
from .segmenter import Segmenter

FOLDER = Path(__file__).resolve().parents[2] / "networks"
SILHOUETTES = {"selfie_segmentation.tflite": 256, "selfie_segmentation_landscape.tflite": 144}
"""Two networks that segment the largest figure, and the rows of their inputs, of 256 columns each."""
POSE, BODY = "pose_detection.onnx", "pose_landmark_full.tflite"
"""One that detects people, and one that segments a person."""
ALIGNMENT = slice(33, 35)
"""Points of `BODY`: the middle of the hips and a point on the circle around the whole body."""
OVERLAP = 0.3
"""Intersection over union from which on two detections are one, as MediaPipe merges them."""


@dataclass(frozen=True)
class Anchors:
    """Places at which a detector looks: a side of its input and the strides of its layers, in pixels."""

    side: int
    strides: tuple[int, ...]

    @cached_property
    def centres(self) -> Floats:
        """(n, 2) centres x, y in shares of the input; two anchors a cell for each layer of two or more."""
        rows = []
        for stride in dict.fromkeys(self.strides):
            cells = self.side // stride
            along = (np.arange(cells) + 0.5) / cells
            layers = self.strides.count(stride)
            grid = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
            rows.append(np.repeat(grid, 2 * layers if layers > 1 or len(self.strides) > 1 else 1, axis=0))
        return np.concatenate(rows)


FAR_FACES = Anchors(192, (4,))
POSES = Anchors(224, (8, 16, 32, 32, 32))


@dataclass(frozen=True)
class Detection:
    """A face or a person in a picture."""

    score: float
    """Probability."""
    box: Floats
    """(4,) left, top, right, bottom, in pixels."""
    points: Floats
    """(n, 2) pixels. A face: eyes, nose, mouth, ears. A person: middle of the hips, a point on the circle
    around the whole body, middle of the shoulders, a point on the circle around the upper body."""


@dataclass(frozen=True)
class Region:
    """A turned square of a picture, in which a body stands upright."""

    centre: Floats
    """(2,) pixels."""
    side: float
    """Pixels."""
    up: Floats
    """(2,) unit vector towards the head."""

    @classmethod
    def of(cls, person: Detection) -> Region:
        """Return the square around a whole body, 1.25 times as large as the circle around it."""
        return cls.around(person.points[0], person.points[1])

    @classmethod
    def around(cls, hips: Floats, rim: Floats) -> Region:
        """Return it by the middle of the hips (2,) and a point (2,) on the circle around the whole body."""
        radius = float(np.linalg.norm(rim - hips))
        return cls(hips, 2.5 * radius, (rim - hips) / max(radius, 1e-9))

    @property
    def feet(self) -> Floats:
        """(2,) pixels where the body stands, also outside of the picture."""
        return self.centre - self.up * self.side / 2.5

    def to_square(self, side: int) -> Floats:
        """Return the affine map (2, 3) from pixels of the picture to pixels of a square of `side` pixels."""
        right = np.array([-self.up[1], self.up[0]])
        turned = np.stack([right, -self.up]) * side / self.side
        return np.column_stack([turned, side / 2 - turned @ self.centre])


class Networks:
    """The networks, loaded when they are first used; several threads may use them, one at a time."""

    def __init__(self, folder: Path = FOLDER, segmenter: Path | None = None) -> None:
        """`segmenter` is the file of the user's own segmenter."""
        self._folder, self._file = folder, segmenter
        self._lock = Lock()
        self._loaded: dict[str, cv2.dnn.Net] = {}

    @property
    def exist(self) -> bool:
        """Return whether the extension was built with the networks."""
        return (self._folder / POSE).is_file()

    @cached_property
    def segmenter(self) -> Segmenter | None:
        """The user's own segmenter, if one is named; UserError where it cannot be read."""
        return None if self._file is None else Segmenter(self._file)

    def load(self) -> None:
        """Load those that cut out a subject, which takes 0.1 s; nothing without networks."""
        for name in (*SILHOUETTES, POSE, BODY) if self.exist else ():
            with self._lock:
                self._net(name)

    def silhouette(self, picture: Bytes) -> Map:
        """Estimate where a picture shows a person or an animal that fills much of it.

        Args:
            picture: (h, w, 3) uint8 RGB, display-encoded.

        Returns:
            (h, w) float32 log-odds, the mean of two networks, limited to those of 0.02 and 0.98.
        """
        found = [
            log_odds(self._run(name, _stretched(picture, 256, rows))[0]) for name, rows in SILHOUETTES.items()
        ]
        size = picture.shape[1::-1]
        both = [
            cv2.resize(each.reshape(rows, 256), size)
            for each, rows in zip(found, SILHOUETTES.values(), strict=True)
        ]
        return np.asarray((both[0] + both[1]) / 2, np.float32)

    def poses(self, picture: Bytes, least: float) -> list[Detection]:
        """Return people in a picture (h, w, 3), uint8 RGB, of at least a probability, the surest first."""
        return self._detected(POSE, picture, POSES, least)

    def faces(self, picture: Bytes, least: float) -> list[Detection]:
        """Return faces in a picture (h, w, 3), uint8 RGB, of at least a probability, the surest first.

        Those of a small part of the picture are found, too.
        """
        return self._detected("face_detection_full_range_sparse.onnx", picture, FAR_FACES, least)

    def body(self, picture: Bytes, region: Region) -> tuple[Map, float, Region]:
        """Segment the person in a region.

        Args:
            picture: (h, w, 3) uint8 RGB, display-encoded.
            region: Area of the person.

        Returns:
            (h, w) float32 probability, 0 outside of the region, the probability that a person is there, and
            the area around the person as this network sees it, for the next frame.
        """
        turned = region.to_square(256)
        square = cv2.warpAffine(picture, turned, (256, 256), flags=cv2.INTER_AREA)
        points, presence, mask = self._run(BODY, _stretched(square, 256, 256))[:3]
        back = cv2.invertAffineTransform(turned)
        hips, rim = points.reshape(-1, 5)[ALIGNMENT, :2] @ back[:, :2].T + back[:, 2]
        found = 1 / (1 + np.exp(-np.clip(mask.reshape(256, 256), -30, 30)))
        placed = cv2.warpAffine(
            found, turned, picture.shape[1::-1], flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        )
        return np.asarray(placed, np.float32), float(presence.item()), Region.around(hips, rim)

    def _detected(self, name: str, picture: Bytes, anchors: Anchors, least: float) -> list[Detection]:
        height, width = picture.shape[:2]
        side = max(height, width)
        square = np.zeros((side, side, 3), np.uint8)
        left, top = (side - width) // 2, (side - height) // 2
        square[top : top + height, left : left + width] = picture
        found, scores = self._run(name, 2 * _stretched(square, anchors.side, anchors.side) - 1)
        return decoded(found[0], scores.ravel(), anchors, least, np.array([left, top]), side)

    def _run(self, name: str, blob: NDArray[np.float32]) -> tuple[NDArray[np.float32], ...]:
        with self._lock:
            net = self._net(name)
            net.setInput(blob)
            return tuple(net.forward(sorted(net.getUnconnectedOutLayersNames())))

    def _net(self, name: str) -> cv2.dnn.Net:
        """A network; the lock is held."""
        if name not in self._loaded:
            self._loaded[name] = _read(self._folder / name)
        return self._loaded[name]


def decoded(
    raw: NDArray[np.float32],
    scores: NDArray[np.float32],
    anchors: Anchors,
    least: float,
    corner: Floats,
    side: int,
) -> list[Detection]:
    """Decode what a detector of MediaPipe's returns (weighted non-maximum suppression, as in BlazeFace).

    Args:
        raw: (n, 2k) centre, size and points of a detection at each of n anchors, in pixels of the input.
        scores: (n,) log-odds.
        anchors: Those of the network.
        least: Probability from which on a detection is returned.
        corner: (2,) pixels of the square input left of and above the picture.
        side: Pixels of the square that the network saw.

    Returns:
        Detections in pixels of the picture, the surest first.
    """
    probability = 1 / (1 + np.exp(-np.clip(scores.astype(float), -100, 100)))
    sure = np.flatnonzero(probability >= least)
    sure = sure[np.argsort(-probability[sure], kind="stable")]
    pairs = raw[sure].reshape(len(sure), raw.shape[1] // 2, 2).astype(float) / anchors.side
    pairs[:, [0, *range(2, pairs.shape[1])]] += anchors.centres[sure, None]
    boxes = np.concatenate([pairs[:, 0] - pairs[:, 1] / 2, pairs[:, 0] + pairs[:, 1] / 2], axis=1)
    values = np.concatenate([boxes, *pairs[:, 2:].swapaxes(0, 1)], axis=1)
    weights, found, left = probability[sure], list[Detection](), np.arange(len(sure))
    while len(left):
        near = _overlaps(boxes[left[0]], boxes[left]) > OVERLAP
        near[0] = True
        mean = (
            np.average(values[left[near]], axis=0, weights=weights[left[near]]).reshape(-1, 2) * side - corner
        )
        found.append(Detection(float(weights[left[0]]), mean[:2].ravel(), mean[2:]))
        left = left[~near]
    return found


MISSING = "people are not recognized: this build of the extension has no networks"


def _read(path: Path) -> cv2.dnn.Net:
    if not path.is_file():
        raise UserError(MISSING)
    read = cv2.dnn.readNetFromONNX if path.suffix == ".onnx" else cv2.dnn.readNetFromTFLite
    # OpenCV's newer engine names only one output of the TensorFlow Lite models.
    return read(str(path), cv2.dnn.ENGINE_CLASSIC)


def _stretched(picture: Bytes, width: int, height: int) -> NDArray[np.float32]:
    """(1, 3, height, width) of a picture (h, w, 3), in [0, 1]."""
    return np.asarray(
        cv2.dnn.blobFromImage(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), 1 / 255)
    )


def log_odds(probability: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the log-odds of probabilities, limited to those of 0.02 and 0.98."""
    limited = np.clip(probability, 0.02, 0.98)
    return np.asarray(np.log(limited / (1 - limited)), np.float32)


def _overlaps(box: Floats, boxes: Floats) -> Floats:
    """(n,) intersection over union of a box (4,) and boxes (n, 4)."""
    inside = np.minimum(box[2:], boxes[:, 2:]) - np.maximum(box[:2], boxes[:, :2])
    shared = np.prod(np.clip(inside, 0, None), axis=1)
    areas = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    return np.asarray(shared / np.maximum(np.prod(box[2:] - box[:2]) + areas - shared, 1e-12))
