"""Direction and position of the light in every frame, relative to the head, and whether the light suffices."""
