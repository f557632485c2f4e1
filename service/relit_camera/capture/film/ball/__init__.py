"""The mirror balls of a film: found, followed, and read for the lamp's mirror image."""
