"""The code that runs inside the environment of Cycles: bpy and numpy only."""
