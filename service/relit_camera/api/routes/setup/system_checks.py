"""The route of the checks: what the camera needs of this machine, and the cure of what is missing."""

from __future__ import annotations

from relit_camera.api.dependencies import ApiContextDep
from relit_camera.api.openapi.api_router import api_router
from relit_camera.live.status.setup_status import Check

router = api_router("setup")


@router.get("/checks")
def get_checks(api: ApiContextDep) -> tuple[Check, ...]:
    """What the camera needs, and whether it is there: what `relit doctor` says, at most some seconds old."""
    return api.camera.setup.checks()
