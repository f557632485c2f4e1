"""A camera in the user's PipeWire session: the C library's functions and values, the node, and the sink."""
