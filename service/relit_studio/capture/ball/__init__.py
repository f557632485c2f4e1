"""The mirror ball of a capture, and what it reflects."""
