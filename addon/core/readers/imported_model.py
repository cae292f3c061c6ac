"""What every reader of another program's solve hands over, before it is matched with the clip."""

from __future__ import annotations

from dataclasses import dataclass

from ..camera.reconstruction import Reconstruction


@dataclass(frozen=True)
class ImportedModel:
    """A model as its file tells it, in our conventions, with images that know no clip yet."""

    format: str
    """For people: "COLMAP binary", "Bundler v0.3"."""
    reconstruction: Reconstruction
    """`Image.frame` is an index into `names`; units, origin and orientation are the file's own."""
    names: tuple[str, ...]
    """Of all the file's images in its order, registered or not; empty strings where it names none."""
    notes: tuple[str, ...] = ()
    """What the user should know: what was skipped, assumed or not understood."""
    projected: bool = False
    """The file stores no feature positions: each feature is put where its point projects."""
