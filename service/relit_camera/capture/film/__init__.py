"""Capture from a film of a person, one or two mirror balls, and a blinking lamp that moves about (thesis 4.3)."""
