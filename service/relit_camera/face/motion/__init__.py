"""Motion of a face from frame to frame: smoothing, the neutral face, easing between trackers."""
