"""What `python -m relit_studio.mannequin` writes."""
