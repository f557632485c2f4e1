"""Which long work excludes which."""

from __future__ import annotations

from relit_camera.api.dependencies import ApiContext
from relit_camera.base.errors import ConflictError


def require_no_replay(api: ApiContext) -> None:
    """Check that no video is being relit: such work takes all of the processor that the camera leaves.

    Raises:
        ConflictError: one is.
    """
    if any(each.stage.is_running for each in api.camera.replays.all()):
        raise ConflictError("a video is being relit", "wait for its end, or delete it")
