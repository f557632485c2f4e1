"""Sources, which give the live pictures: a webcam, a video or picture file, or the test pattern."""
