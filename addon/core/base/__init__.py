"""Shared foundations: errors, progress and cancelling, atomic files, locks and processes."""
