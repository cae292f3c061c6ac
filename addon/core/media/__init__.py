"""Clips and the files beside them: frames, metadata, masks, and the identity of a clip."""
