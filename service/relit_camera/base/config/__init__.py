"""What a person can set: one pydantic model a topic, with title, range and default of every field.

`look` holds what changes while the camera runs (lighting, background, mode), `settings` what is fixed for a run,
`load` reads YAML, environment and command line.
"""
