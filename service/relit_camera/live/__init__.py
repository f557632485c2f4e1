"""Frames through the house: sources, the latest-frame slot, the pipeline, the worker, the publisher, sinks."""
