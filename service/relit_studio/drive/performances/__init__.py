"""The performances of driving videos: what a person does before the webcam, one module each."""
