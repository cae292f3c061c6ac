"""The sidebar panels, in the order of the work: what everybody needs, and the rest in closed sub-panels."""

from __future__ import annotations

from . import focus, footage, lens, preview, render, solve

CLASSES = (*footage.CLASSES, *solve.CLASSES, *focus.CLASSES, *lens.CLASSES, *preview.CLASSES, *render.CLASSES)
