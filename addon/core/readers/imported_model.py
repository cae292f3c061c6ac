"""The output of every reader, before it is matched with the clip."""

from __future__ import annotations

from dataclasses import dataclass

from ..camera.reconstruction import Reconstruction


@dataclass(frozen=True)
class ImportedModel:
    """A model as in its file, in our conventions, with images that are not matched with a clip."""

    format: str
    """For people: "COLMAP binary", "Bundler v0.3"."""
    reconstruction: Reconstruction
    """`Image.frame` is an index into `names`; units, origin and orientation are the file's own."""
    names: tuple[str, ...]
    """Names of all images in the file's order, registered or not; empty strings without names."""
    notes: tuple[str, ...] = ()
    """Notes for the user: skipped, assumed and unknown content."""
    projected: bool = False
    """The file stores no feature positions: each feature is put where its point projects."""
