"""From pictures under patches of the screen to the field of a person: near field, generic head, appearance."""
