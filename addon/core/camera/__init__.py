"""Cameras: poses, intrinsics, lens distortion, and the undistorted canvas."""
