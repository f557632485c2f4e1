"""Face trackers, their networks, and recorded tracks."""
