"""One frame from the clip to its plan of views: clip context, meshers, highlights, quality, reports."""
