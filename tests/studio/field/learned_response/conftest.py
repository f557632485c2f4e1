"""The networks that a capture needs."""

from tests.capture.instant.conftest import models, pulled_models

__all__ = ["models", "pulled_models"]
