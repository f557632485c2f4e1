"""Checks of the programs that read the camera: browsers, call apps, and the portal that gives them cameras."""
