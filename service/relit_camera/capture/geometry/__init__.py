"""Shape from OLAT pictures: normals, albedo, depth, and which light reaches which pixel."""
