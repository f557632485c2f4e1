"""The inside of a mouth that was never captured: teeth, gums and tongue, drawn where the lips part."""
