"""The common result of all readers, before and after it is matched with the clip."""

from dataclasses import dataclass

import numpy as np

from ..camera.reconstruction import Reconstruction


@dataclass(frozen=True)
class Imported:
    """An imported model in our conventions, not normalised."""

    reconstruction: Reconstruction
    """`Image.frame` is an index into `names`; once matched, the clip's frame number, in order."""
    format: str
    """Displayed name: "COLMAP binary", "Bundler v0.3"."""
    notes: tuple[str, ...] = ()
    """Remarks for the user on skipped, assumed or invalid content, one sentence each."""
    names: tuple[str, ...] = ()
    """Names of all images in the file's order, registered or not, until they are matched; empty strings if it
    has none."""
    projected: bool = False
    """True if the file has no feature positions, so that features are the projections of points."""
    placed: bool = False
    """True if the world is that of an existing scene, and must not be moved."""

    @property
    def lacks_points(self) -> bool:
        """Return whether no point is seen by two frames, as for points computed from depth."""
        return not np.any(self.reconstruction.views_per_point > 1)
