"""Motion of a face from frame to frame: smoothing, blending between trackers, the neutral face."""
