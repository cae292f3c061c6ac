"""Faults of every kind thrown at the command line: what it calls done is right, nothing is lost or left."""
