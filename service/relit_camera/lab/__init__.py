"""Measurements of quality and speed for developers: evaluations and benchmarks."""
