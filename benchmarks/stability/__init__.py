"""Hard numerical cases."""
