"""What a person saw in the pictures, by the commit of the program that made them: one honest line a clip."""

SEEN: dict[str, dict[str, str]] = {}
"""Short commit -> clip -> what is seen. A line is shown beside pictures of that commit alone."""
