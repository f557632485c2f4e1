"""Sources, where frames come from: webcam, video file, picture, test pattern."""
