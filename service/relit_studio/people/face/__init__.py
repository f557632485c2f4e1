"""Shape of the face: model, identity, expression, eyes and landmarks."""
