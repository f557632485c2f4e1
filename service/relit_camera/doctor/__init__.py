"""What keeps the camera from working on this machine, and the cure: `relit doctor`."""
