"""The HTTP server: sockets, connections, start and stop."""
