"""Fields of the forms by which films, videos and subjects are sent, and of bodies that begin such work."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from relit_camera.api.bodies.schemas import ApiModel
from relit_camera.base.config.look import StoredName
from relit_camera.live.status.film_status import Circle, FilmOptions

CircleText = Annotated[str, Field(pattern=r"^(\d{1,5}(\.\d{1,3})?,){2}[1-9]\d{0,4}(\.\d{1,3})?$", max_length=40)]
"""x, y and radius in pixels of the upright film, as in `120,80.5,30`; a radius of at least one pixel."""


class FilmOptionFields(ApiModel):
    """How to read a film: the options of `relit capture build` of the same names."""

    light_distance_cm: Annotated[float, Field(ge=20, le=1000)] = 100.0
    """Usual distance of the lamp from the head, where two balls do not measure it."""
    ball_diameter_cm: Annotated[float, Field(ge=1, le=100)] | None = None
    """Diameter of the balls; without it they are taken to be as far from the camera as the head."""
    balls: Annotated[int, Field(ge=1, le=2)] = 1
    """Mirror balls in the film; two of one size measure the lamp's distance."""
    focal_px: Annotated[float, Field(ge=50, le=100_000)] | None = None
    """The camera's focal length in pixels of the upright film, where it is known."""
    size: Annotated[int, Field(ge=64, le=1024)] = 384
    """Pixels a side of the subject; fewer where the film shows fewer."""
    ball: CircleText | None = None
    """X,Y,RADIUS of the mirror ball in pixels of the upright film, where it is not found by itself."""
    second_ball: CircleText | None = None
    """The same of the second ball."""
    face: CircleText | None = None
    """The same of the face, brow to chin."""

    def options(self) -> FilmOptions:
        """These options with the circles as numbers."""
        circles = {name: _circle(getattr(self, name)) for name in ("ball", "second_ball", "face")}
        fields = {name: getattr(self, name) for name in FilmOptionFields.model_fields}
        return FilmOptions(**{**fields, **circles})


class FilmCaptureForm(FilmOptionFields):
    """The fields of the form that a film comes with."""

    name: StoredName
    """Under which the subject is stored; one of that name is replaced."""


class ExpressionCaptureRequest(ApiModel):
    """Whose expression stills are to be taken; also the field of the form that a video for them comes with."""

    subject: StoredName | None = None
    """Name of a stored subject; the one that is shown, if none is given."""


class NameForm(ApiModel):
    """The fields of the form that a subject's file or a video comes with."""

    name: StoredName
    """Under which it, or the relit video, is stored."""


class NewName(ApiModel):
    """Another name for something stored."""

    name: StoredName


def _circle(text: str | None) -> Circle | None:
    if text is None:
        return None
    x, y, radius = map(float, text.split(","))
    return x, y, radius
