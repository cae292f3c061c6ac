"""The thesis's figures from our own scenes."""
