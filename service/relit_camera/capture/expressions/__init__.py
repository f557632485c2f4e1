"""Expression stills from a film of a person who talks and turns."""
