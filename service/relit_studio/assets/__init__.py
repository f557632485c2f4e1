"""Meshes and pictures made by others: fetched on demand, verified, never committed."""
