"""Reenactors: moving the source image as the live face moves."""
