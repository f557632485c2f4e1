"""The command line `relit`: a file a command in `commands/`, which import heavy modules only when they run."""
