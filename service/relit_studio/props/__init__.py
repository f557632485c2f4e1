"""What people hold: a mug, and the hands and sleeves that come with it."""
