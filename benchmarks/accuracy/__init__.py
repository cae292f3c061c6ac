"""Speed against error: every method on every scene against a real lens's picture."""
