"""The keeper: a small process that holds the virtual camera, and shows something while the camera is away."""
