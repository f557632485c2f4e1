"""What the camera needs of the machine: checks, devices, tracker and models, at the start and while it runs."""
