"""The demonstration: a bundled person, their video, and a tour of places that light them."""
