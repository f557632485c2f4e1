"""Benchmarks: what a picture of the running camera costs, and relighting (thesis, Tables 6.1 and 6.2)."""
