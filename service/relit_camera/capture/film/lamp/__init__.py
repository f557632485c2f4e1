"""What the light of a capture is: camera gains, the room's share, where the lamp stands, and who it reaches."""
