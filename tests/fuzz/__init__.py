"""Files that lie: those that once did harm, and mutations of them and of sound files, for every reader."""
