"""What the screen showed and when, told from the frames themselves: plateaus, their patterns, their pictures."""
