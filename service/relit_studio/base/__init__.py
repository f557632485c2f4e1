"""What all parts of the studio use: raw files, progress, resuming, random signals."""
