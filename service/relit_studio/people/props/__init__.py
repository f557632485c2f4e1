"""Objects in front of the person: a mug, hands and sleeves."""
