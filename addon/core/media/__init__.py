"""Clips and what lies beside them: pictures of frames, metadata, masks, and how a clip is recognised."""
