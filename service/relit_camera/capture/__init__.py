"""Capture: from OLAT pictures (RTI .lp) or a film to samples, and from samples to a subject."""
