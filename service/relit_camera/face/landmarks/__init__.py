"""Landmarks: the schemes of points, the canonical face they lie on, and crops around them."""
