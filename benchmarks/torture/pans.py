"""Clips that tell no depth, whatever the lens makes of them."""

from __future__ import annotations

from . import clip
from .bench import Try


def pan(one: Try) -> None:
    """A camera that turns in its place, through a lens with defects: no solve of it is called good."""
    dice, work = one.dice, one.folder / "work"
    pictures = clip.write_walk(
        one.folder / "pan", path=0.0, pan=dice.uniform(0.15, 0.4), zoom=dice.choice([0, 0.1]),
        distortion=dice.choice([0, 0.03, 0.08]), readout=dice.choice([0, 0.5]),
    )  # fmt: skip
    run = one.run("solve", pictures, "--work", work)
    if run.status == 0 and "advice:" not in run.said:
        one.verdict.add("wrong", "a pan was solved with confidence")
    elif run.status == 0:
        one.verdict.note = f"solved, and: {run.said[-200:]}"
