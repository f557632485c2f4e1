"""Where finished pictures go: virtual camera, video file, nowhere, behind one protocol."""
