"""One frame of a clip: context, meshers, highlights, plan of views, quality and reports."""
