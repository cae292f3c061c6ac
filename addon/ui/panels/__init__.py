"""The sidebar panels: one for the daily work, and below it, closed, the rest in the order of the work."""

from ..base.operators import classes_of
from . import focus, lens, main, notices, render, solve

CLASSES = classes_of(main, notices, solve, focus, lens, render)
