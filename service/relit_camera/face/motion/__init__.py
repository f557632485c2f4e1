"""Motion of the face: smoothing, the neutral face, blending, and the follower that combines them."""
