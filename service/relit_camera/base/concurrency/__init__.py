"""Threads: the clock they wait on, the newest-value slot between two of them, and limits on how many there are."""
