"""Routes that tell how well the person sits before the webcam: distance, light, sharpness, exposure."""

from __future__ import annotations

from relit_camera.api.bodies.setup_bodies import FramingWish
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.face.framing.framing import Framing

router = api_router("setup")


@router.get("/framing", responses=error_responses(503))
def get_framing(api: ApiContextDep) -> Framing:
    """How well the person sits before the webcam, in this second."""
    return api.camera.setup.framing()


@router.put("/framing", responses=error_responses(422))
def want_framing(api: ApiContextDep, framing: FramingWish) -> FramingWish:
    """Let the event `framing` tell it some times a second, for ten seconds; a page renews this every five."""
    api.camera.setup.want_framing(framing.wanted)
    return framing
