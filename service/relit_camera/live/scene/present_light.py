"""How far the scene's subject is to be trusted in the scene's light, for the status."""

from __future__ import annotations

from relit_camera.live.scene.light_transition import display_light
from relit_camera.live.scene.scene import Scene
from relit_camera.subject.light_trust import LightTrust, light_trust


class PresentLight:
    """Tells how far a scene's subject is to be trusted in its light. Any thread may ask.

    It is computed where somebody asks, once for each scene: no frame waits for it, and nothing is done while nobody
    looks.
    """

    def __init__(self) -> None:
        self._known: tuple[int, LightTrust | None] | None = None

    def trust(self, scene: Scene) -> LightTrust | None:
        """The trust in the light that the scene goes to; None without a subject, and where no light is on."""
        known = self._known
        if known is None or known[0] != scene.revision:
            known = self._known = (scene.revision, _trust(scene))
        return known[1]


def _trust(scene: Scene) -> LightTrust | None:
    if scene.subject is None:
        return None
    light_map = display_light(scene.environment, scene.look.lighting)
    return light_trust(scene.subject, light_map) if light_map.any() else None
