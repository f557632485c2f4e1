"""The demonstration: a bundled person, a clip of them, and a tour through several environments."""
