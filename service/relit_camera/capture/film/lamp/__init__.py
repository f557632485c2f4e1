"""Where the lamp stood in every frame, relative to the head: position, distance, and whether the light suffices."""
