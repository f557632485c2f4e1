"""Capture: from one-light pictures (RTI .lp) or a film to samples, and from samples to a subject."""
