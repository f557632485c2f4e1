"""Capture from a film: from a video of a face, one or two mirror balls and a blinking lamp that moves about to one linear
picture for each light (thesis 4.3).
"""
