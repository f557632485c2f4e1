"""Finding faces in a whole picture."""
