"""People as numbers: shape, skin, hair, eyes and clothes, in numpy alone."""
