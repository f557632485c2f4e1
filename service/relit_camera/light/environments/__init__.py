"""Environments: the panoramas that light the face, those built in, the store of the user's own, thumbnails."""
