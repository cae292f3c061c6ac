"""The common result of all readers, before it is matched with the clip."""

from dataclasses import dataclass

from ..camera.reconstruction import Reconstruction


@dataclass(frozen=True)
class ImportedModel:
    """A model in our conventions, whose images are not matched with a clip yet."""

    format: str
    """Displayed name: "COLMAP binary", "Bundler v0.3"."""
    reconstruction: Reconstruction
    """`Image.frame` is an index into `names`; units, origin and orientation are the file's own."""
    names: tuple[str, ...]
    """Names of all images in the file's order, registered or not; empty strings if it has none."""
    notes: tuple[str, ...] = ()
    """Remarks for the user on skipped, assumed or invalid content."""
    projected: bool = False
    """True if the file has no feature positions, so that features are the projections of points."""
