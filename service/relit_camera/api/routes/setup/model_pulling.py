"""Routes of the public models: which are missing, and to pull them. Nothing is pulled unless somebody asks for it."""

from __future__ import annotations

from http import HTTPStatus

from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.api.problem_details import error_responses
from relit_camera.live.status.setup_status import ModelPullStatus

router = api_router("setup")


@router.get("/models")
def get_models(api: ApiContextDep) -> ModelPullStatus:
    """Which public models are missing, and how far their pull is; the event `models` tells each step."""
    return api.camera.setup.models()


@router.post("/models", status_code=HTTPStatus.ACCEPTED, responses=error_responses(409))
def pull_models(api: ApiContextDep) -> ModelPullStatus:
    """Pull the public models from their authors, or else from the package index; then the tracker opens by itself."""
    return api.camera.setup.pull_models()


@router.delete("/models")
def cancel_models(api: ApiContextDep) -> ModelPullStatus:
    """End the pull that is under way; models that are stored already stay."""
    return api.camera.setup.cancel_models()
