"""A person under one light after another, over the whole sphere."""
