"""The sidebar panels: one for the daily work, and below it, closed, the rest in the order of the work."""

from __future__ import annotations

from . import clip, focus, lens, main, notices, preview, render, solve

CLASSES = (
    *main.CLASSES,
    *notices.CLASSES,
    *clip.CLASSES,
    *solve.CLASSES,
    *focus.CLASSES,
    *lens.CLASSES,
    *preview.CLASSES,
    *render.CLASSES,
)
