"""Rendered phone captures with ground truth (thesis 4.3)."""
