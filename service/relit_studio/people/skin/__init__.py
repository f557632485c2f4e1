"""Skin of a person, from the scan of a real head."""
