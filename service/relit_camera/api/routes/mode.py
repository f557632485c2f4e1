"""Mode, freezing and the neutral pose."""

from __future__ import annotations

from http import HTTPStatus

from fastapi import APIRouter
from starlette.responses import Response

from relit_camera.api.context import Context
from relit_camera.api.problems import responses
from relit_camera.api.schemas import FreezeBody, ModeBody

router = APIRouter(tags=["control"])


@router.get("/mode")
def get_mode(api: Context) -> ModeBody:
    """How the relit face reaches the picture now."""
    return ModeBody(mode=api.camera.director.scene.look.mode)


@router.put("/mode", responses=responses(422))
def set_mode(api: Context, body: ModeBody) -> ModeBody:
    """Change how the relit face reaches the picture."""
    scene = api.camera.director.update_look(lambda look: look.model_copy(update={"mode": body.mode}))
    return ModeBody(mode=scene.look.mode)


@router.get("/freeze")
def get_freeze(api: Context) -> FreezeBody:
    """Whether the published picture stands still."""
    return FreezeBody(frozen=api.camera.director.scene.frozen)


@router.put("/freeze", responses=responses(422))
def set_freeze(api: Context, body: FreezeBody) -> FreezeBody:
    """Hold the published picture, or let it go on."""
    return FreezeBody(frozen=api.camera.director.set_frozen(body.frozen).frozen)


@router.post("/neutral-pose", status_code=HTTPStatus.ACCEPTED, response_class=Response)
def reset_neutral_pose(api: Context) -> Response:
    """Take the present head pose as neutral, from the next frame in which the face is found."""
    api.camera.reset_neutral_pose()
    return Response(status_code=HTTPStatus.ACCEPTED)
