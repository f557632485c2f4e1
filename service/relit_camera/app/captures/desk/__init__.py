"""A desk capture beside the running camera: its filming, and what its worker process does."""
