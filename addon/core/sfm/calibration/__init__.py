"""Lens, shutter and kind of motion of a clip, as far as its tracks determine them."""
