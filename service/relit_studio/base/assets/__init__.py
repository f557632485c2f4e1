"""Meshes and pictures by other authors: fetched on demand, verified, never committed."""
