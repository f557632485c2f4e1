"""Driving videos: a person who talks and turns in a given room, with the truth of every frame."""
