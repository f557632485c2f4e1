"""Worker inside Cycles' environment. It may import bpy and numpy, and no other part of this project."""
