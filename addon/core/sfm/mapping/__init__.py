"""Cameras and points of a whole clip, of photos, or for cameras that are known."""
