"""One-light pictures → the shape that they show: normals, albedo, depth, and which light reaches which pixel."""
