"""The scene: subject, environment, lamps, background and transitions between them."""
