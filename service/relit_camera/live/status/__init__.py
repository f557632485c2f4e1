"""The status of the running service: events, rates and the time each stage takes."""
