"""Evaluation of how well a film of a face is stabilized."""
