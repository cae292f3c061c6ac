"""Structure from motion against the truth."""
