"""The stages of a solve, and how far they are, for the process that waits for it."""

from ..base.messages import Progress, send

SHARES = {
    "Tracking features": (0.0, 0.22),
    "Finding features": (0.0, 0.22),
    "Matching photos": (0.22, 0.75),
    "Placing photos": (0.75, 1.0),
    "Verifying matches": (0.22, 0.29),
    "Comparing cameras": (0.22, 0.88),
    "Solving cameras": (0.29, 0.45),
    "Settling the focal length": (0.45, 0.64),
    "Looking for a lens": (0.64, 0.86),
    "Finding how the camera turns": (0.86, 1.0),
    "Registering frames": (0.86, 0.88),
    "Adjusting": (0.88, 1.0),
    "Looking for people": (0.88, 0.88),
}
"""Which part of the whole each stage is, from the times of the duck and the sample clip."""


def progress(stage: str, done: int, total: int) -> None:
    """Show that `done` of the `total` steps of a stage are done."""
    low, high = SHARES.get(stage, (0.0, 1.0))
    send(Progress(stage, done, total, share=low + (high - low) * done / max(total, 1)))
