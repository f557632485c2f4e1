"""What every HTTP request passes: body limits, checks of token and origin, error handlers."""
