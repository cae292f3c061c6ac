"""Least squares over cameras and points: bundle adjustment, resection and their model of the lens."""
