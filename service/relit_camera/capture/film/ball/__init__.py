"""The mirror ball: from pictures to the direction of the light."""
