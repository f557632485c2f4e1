"""Geometry of the mannequin, and its expressions and colors."""
