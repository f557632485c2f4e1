"""Cycles as a renderer: an environment of its own, jobs as files, and the worker that runs them there."""
