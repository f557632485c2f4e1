"""Landmark schemes, the canonical face, and measurements on landmarks."""
