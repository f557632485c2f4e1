"""Measuring what was built against what is known: fields, leave-out, relit videos; reports a person can read."""
