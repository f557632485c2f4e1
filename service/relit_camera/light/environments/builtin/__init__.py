"""The six built-in environments, each painted by a module's `paint() -> radiance` in viewer axes."""
