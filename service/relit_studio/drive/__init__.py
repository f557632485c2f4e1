"""Rendered driving videos: a person who talks and turns in a given room, with the ground truth of every frame."""
