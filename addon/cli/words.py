"""Names of the remedies of errors on the command line."""

from ..core.base.errors import Remedy, Words
from ..core.base.limits import KEPT_DEPTH

WORDS: Words = {
    Remedy.FRAMES: "--frames A-B",
    Remedy.STEP: "--frames A-B:STEP",
    Remedy.WORK_DIR: "--work DIR",
    Remedy.SOLVE: "headless.py solve FOOTAGE --work DIR",
    Remedy.AGAIN: "--again",
    Remedy.FOCAL: "--focal, --focal35, --focal-mm or --fov",
    Remedy.DEPTH_MAPS: "--depth-maps PATH",
    Remedy.OVERWRITE: "--overwrite",
    Remedy.STILLS: "--stills",
    Remedy.PIXEL_ASPECT: "--pixel-aspect X",
    Remedy.KEPT_DEPTH: KEPT_DEPTH,
}
SOLVED_WORDS: Words = {
    **WORDS,
    Remedy.FRAMES: "--solve-frames A-B",
    Remedy.STEP: "--solve-frames A-B:STEP",
    Remedy.DEPTH_MAPS: "--depth PATH",
}
"""Words of commands whose `--frames` are the rendered ones, and whose depth maps are the lens's."""
IMPORT_WORDS: Words = {**WORDS, Remedy.DEPTH_MAPS: "render DIR --depth PATH"}
"""Words of `import`, whose depth maps are those of a later render."""
