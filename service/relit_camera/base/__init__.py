"""What every other part builds on: errors, storage, pictures, video, neural networks, settings."""
