"""On-demand mode: the webcam is open only while somebody reads the virtual camera or watches a preview."""
