"""Names of the remedies of errors in the interface."""

from ...core.base.errors import Remedy, Words

WORDS: Words = {
    # The interface solves whole clips.
    Remedy.FRAMES: "trim the clip to one of them, in the Video Editor for example",
    Remedy.WORK_DIR: "Working Folder",
    Remedy.SOLVE: "Solve Clip",
    Remedy.AGAIN: "Solve Again",
    Remedy.FOCAL: "Lens",
    Remedy.DEPTH_MAPS: "Depth Maps",
    Remedy.STILLS: "Unordered Photos",
    Remedy.PIXEL_ASPECT: "Pixel Aspect",
}
