"""A subject from a few ordinary frames: a generic head is fitted, then the room's light and the skin are estimated."""
