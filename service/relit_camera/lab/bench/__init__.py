"""Benchmarks of this machine: relighting (thesis, tables 6.1 and 6.2) and each stage of the live pipeline."""
