"""Frame → face state: detector, landmarks, head pose, smoothing. Trackers stand behind one interface."""
