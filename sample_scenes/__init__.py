"""Scenes built by code, with known cameras: the sample clip of the demonstration and the benchmarks."""
