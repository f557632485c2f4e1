"""Reenactment: from the motion of the live face to a warp of the relit source image."""
