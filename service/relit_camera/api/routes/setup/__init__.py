"""Routes of what a user sets up: checks, devices, source, tracker, models, and how to sit before the webcam."""
