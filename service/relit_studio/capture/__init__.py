"""Simulated phone capture videos with known truth (thesis 4.3)."""
