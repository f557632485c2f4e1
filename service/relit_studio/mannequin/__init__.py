"""Procedural mannequin: a bust made by code alone, with pictures under any light and their truth."""
