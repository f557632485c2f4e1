"""Where live pictures come from: webcam, video file, picture, test pattern, behind one protocol."""
