"""Structure from motion: feature tracks, cameras, points, and the working folder that keeps them."""
