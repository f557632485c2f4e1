"""Hair of a person: head hair, brows, lashes and beard."""
