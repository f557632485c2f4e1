"""What the camera's parts cost as their sizes grow: curves, their plots and tables."""
