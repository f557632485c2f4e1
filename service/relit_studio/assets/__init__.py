"""Meshes and pictures of other authors: fetched on demand, verified, never committed."""
