"""Slow studies, run by hand; nothing here is a test."""
