"""What depth, mesh and views cost on this machine."""
