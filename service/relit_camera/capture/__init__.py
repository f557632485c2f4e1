"""Capture: from OLAT pictures (RTI .lp) or from a film to samples, to a reflectance field, to a subject."""
