"""The phone capture video whose truth is known (thesis 4.3)."""
