"""Operators that take the mouse over the camera view or selected vertices."""
