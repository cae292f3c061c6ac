"""Frames, movies and exports on disk."""
