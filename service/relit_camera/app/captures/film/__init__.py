"""A capture from a film that was sent: its files, what the worker process does, and the report."""
