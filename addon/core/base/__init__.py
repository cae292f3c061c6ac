"""Foundations of all rooms: errors, progress and cancelling, atomic files, locks."""
