"""What every HTTP request passes: access control, limits of size and time, headers."""
