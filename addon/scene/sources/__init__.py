"""The clip of a scene and its companions: masks, subjects, sound, color spaces, other cameras."""
