"""The face in a frame: trackers, landmarks, head pose, and its motion relative to neutral."""
