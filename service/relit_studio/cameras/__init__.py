"""Cameras of the studio: projection, and what a small camera does to light."""
