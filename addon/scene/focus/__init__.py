"""Focus marks of a scene, their F-curve, and the focus over a new solve."""
