"""`relit doctor`: checks of everything that the camera needs on this machine, each with its cure."""
