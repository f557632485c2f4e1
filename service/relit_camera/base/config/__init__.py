"""Settings: one pydantic model for each topic, with description, range and default of every field.

What changes while the camera runs (lighting, background, mode) is the look; the other settings are fixed for a run.
"""
