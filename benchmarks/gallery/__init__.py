"""Real clips through the command line, with pictures to look at and figures that need no truth."""
