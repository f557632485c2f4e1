"""Evaluation of live video against rendered truth."""
