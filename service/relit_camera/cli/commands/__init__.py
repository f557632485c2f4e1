"""The commands of `relit`, one module each."""
