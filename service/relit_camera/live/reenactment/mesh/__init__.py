"""The moved head as a mesh: the face and its eyes, what lies beside it, and how triangles are drawn."""
