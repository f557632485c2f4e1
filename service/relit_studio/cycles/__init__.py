"""Rendering with Cycles: its own Python environment, jobs as files, and the worker that runs them there."""
