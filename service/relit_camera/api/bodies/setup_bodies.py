"""Bodies of requests to the routes of the set-up; the answers are those of `live.status.setup_status`."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from relit_camera.api.bodies.schemas import ApiModel
from relit_camera.base.config.settings import EvenSize


class SourceChange(ApiModel):
    """What shall change of the source; what is left out stays."""

    device: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """A webcam's `device` of `GET devices`, `pattern`, or the source that the camera was started with."""
    width: EvenSize | None = None
    """Asked of the webcam; it may answer with another size."""
    height: EvenSize | None = None
    fps: Annotated[float, Field(ge=1, le=240)] | None = None


class TrackerBody(ApiModel):
    """Which tracker follows the face."""

    name: Annotated[str, Field(min_length=1, max_length=200)]
    """One of the `names` of `GET tracker`."""


class FramingWish(ApiModel):
    """Whether the framing shall be judged."""

    wanted: bool
