"""Trackers: face detector, landmark networks, the tracking loop, and recorded tracks."""
