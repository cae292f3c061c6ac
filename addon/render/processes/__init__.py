"""Other processes that render shares of a scene."""
