"""On demand: the webcam is let go while nobody looks, and taken again when somebody does."""
