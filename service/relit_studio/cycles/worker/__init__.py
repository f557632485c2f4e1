"""What runs inside Cycles' environment: bpy and numpy, nothing else of ours."""
