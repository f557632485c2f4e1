"""The composition root: from settings to a running service, and the programs that start one."""
