"""The unattended way from a film to samples: its stages in order, options, report and checkpoint."""
