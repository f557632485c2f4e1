"""People as numbers: shape, skin, hair, eyes and clothes, with numpy only."""
