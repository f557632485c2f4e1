"""Driving videos: a person who talks and turns the head in a given room, with the truth of every frame."""
