"""The color of a person: what skin may have, what the picture shows of it, and what the eyes tell."""
