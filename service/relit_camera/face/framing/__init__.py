"""How well a person sits before the webcam: distance, position, light, sharpness, exposure."""
