"""The performances, one file each."""
