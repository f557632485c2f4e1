"""Capture from a film: a face, one or two mirror balls and a moving lamp become one linear picture for each light."""
