"""Choosing, importing, solving and restoring a clip."""
