"""The whole way from a video to samples, unattended."""
