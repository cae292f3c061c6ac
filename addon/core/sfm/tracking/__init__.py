"""Feature tracks of a clip, matched photos, and checks of their motion."""
