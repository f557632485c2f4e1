"""The commands of `python -m relit_studio`, one a file."""
