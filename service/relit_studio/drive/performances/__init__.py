"""What people do before the webcam: one file a performance."""
