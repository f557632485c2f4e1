"""What runs for every frame: pipeline, modes, reenactment, compositing, scene, supervision, publishing, status."""
