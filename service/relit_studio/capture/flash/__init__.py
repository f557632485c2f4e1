"""The blinking torch of a capture: path, timing and shadow."""
