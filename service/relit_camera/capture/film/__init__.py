"""Capture from a film: from a video of a face under a moving lamp to one linear picture for each light."""
