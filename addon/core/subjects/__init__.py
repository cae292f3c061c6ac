"""Subjects that move by themselves: found in the clip, or marked by strokes, whole and in every frame."""
