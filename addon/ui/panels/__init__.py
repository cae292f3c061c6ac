"""The sidebar panels, in the order of the work: what everybody needs, and the rest in closed sub-panels."""

from __future__ import annotations

from . import focus, footage, lens, render, solve

CLASSES = (*footage.CLASSES, *solve.CLASSES, *focus.CLASSES, *lens.CLASSES, *render.CLASSES)
