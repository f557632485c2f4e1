"""Evaluations against ground truth: reflectance fields, hold-out, relit videos, captures, stabilization."""
