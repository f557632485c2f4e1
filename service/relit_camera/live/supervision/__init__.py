"""Supervision of the pipeline: its worker thread, its recovery, and what is shown meanwhile."""
