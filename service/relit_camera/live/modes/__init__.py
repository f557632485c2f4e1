"""The modes of the live pipeline: reenactment of a source image, and relighting of the webcam's own picture."""
