"""The operations, one file a topic."""
