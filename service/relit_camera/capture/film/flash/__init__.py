"""Which frames of a film a blinking light lit: its schedule, the camera's shutter, and the class of every frame."""
