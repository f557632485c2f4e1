"""Cycles as a renderer: its own Python environment, jobs as files, and the worker that runs them there."""
