"""Benchmarks: relighting (thesis, Tables 6.1 and 6.2) and each stage of the live pipeline."""
