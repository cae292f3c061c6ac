"""The thin lens: focus, aperture sampling, the plan of a frame's views, and reports of it."""
