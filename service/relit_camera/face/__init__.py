"""Faces: tracking in frames, landmarks and head pose, and smooth motion relative to a neutral face."""
