"""Publishing of frames to a sink at a steady rate, and the placeholder shown without a camera."""
