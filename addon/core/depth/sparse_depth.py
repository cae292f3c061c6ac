"""The feature points as a source of depth."""

from dataclasses import dataclass

from ..base.arrays import LinearRGBA
from ..camera.canvas import Canvas
from ..camera.reconstruction import Reconstruction
from .source import DepthSource
from .sparse import FrameFeatures, frame_features


@dataclass(frozen=True)
class SparseDepth(DepthSource):
    """Samples for coarse meshes from feature points; pixels between them are unknown."""

    reconstruction: Reconstruction

    def at(self, frame: int, canvas: Canvas, picture: LinearRGBA) -> None:
        """Return None: pixels are unknown."""

    def samples(self, frame: int, canvas: Canvas) -> FrameFeatures:
        """Return the frame's feature points."""
        return frame_features(self.reconstruction, frame, canvas)
