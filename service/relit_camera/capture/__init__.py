"""From pictures or video to samples. Today: one-light pictures with known directions (RTI .lp)."""
