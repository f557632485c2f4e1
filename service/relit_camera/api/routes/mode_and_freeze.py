"""Routes of the mode, of freezing the picture, and of the neutral pose."""

from __future__ import annotations

from http import HTTPStatus

from starlette.responses import Response

from relit_camera.api.bodies.schemas import FreezeBody, ModeBody
from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses

router = api_router("control")


@router.get("/mode")
def get_mode(api: ApiContextDep) -> ModeBody:
    """How the relit face reaches the picture now."""
    return ModeBody(mode=api.camera.scene_controller.scene.look.mode)


@router.put("/mode", responses=error_responses(409, 422))
def set_mode(api: ApiContextDep, body: ModeBody) -> ModeBody:
    """Change how the relit face reaches the picture."""
    scene = api.camera.scene_controller.update_look(lambda look: look.model_copy(update={"mode": body.mode}))
    return ModeBody(mode=scene.look.mode)


@router.get("/freeze")
def get_freeze(api: ApiContextDep) -> FreezeBody:
    """Whether the published picture stands still."""
    return FreezeBody(frozen=api.camera.scene_controller.scene.frozen)


@router.put("/freeze", responses=error_responses(422))
def set_freeze(api: ApiContextDep, body: FreezeBody) -> FreezeBody:
    """Hold the published picture, or let it go on."""
    return FreezeBody(frozen=api.camera.scene_controller.set_frozen(body.frozen).frozen)


@router.post("/neutral-pose", status_code=HTTPStatus.ACCEPTED, response_class=Response)
def reset_neutral_pose(api: ApiContextDep) -> Response:
    """Take the present head pose as neutral, from the next frame in which the face is found."""
    api.camera.reset_neutral_pose()
    return Response(status_code=HTTPStatus.ACCEPTED)
