"""The scene that a run begins with: its place is painted and its subject read while the program is still imported."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor, wait
from typing import Self

from relit_camera.base.concurrency.decoding_process import DECODING_PROCESS
from relit_camera.base.concurrency.resident_memory import large_allocations_apart
from relit_camera.base.concurrency.threads import limit_threads
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.storage.atomic_files import remove_unfinished_files
from relit_camera.live.scene.kept_scene import GivenOptions, show_first_scene
from relit_camera.live.scene.scene_controller import SceneController


class FirstScene:
    """Shows the first scene, in a thread of its own.

    NumPy and OpenCV let other threads run while they compute, so that one core does this while another one imports the
    rest of the program: this module imports no more than a scene needs. Whoever begins it leaves it as a context, so
    that a program that ends meanwhile waits for no file to be decoded.
    """

    def __init__(
        self,
        settings: RelitSettings,
        environment: str | None = None,
        instant: bool = False,
        given: GivenOptions | None = None,
    ) -> None:
        """Begin. The arguments are those of `live.scene.kept_scene.show_first_scene`."""
        limit_threads()
        for folder in (settings.storage.data_dir, *settings.storage.folders):
            remove_unfinished_files(folder)  # of an earlier run that was killed
        self._controller = SceneController(settings.storage)

        def show() -> None:
            with large_allocations_apart(tidied=False):
                show_first_scene(self._controller, settings, environment, instant, given)

        with_one_thread = ThreadPoolExecutor(1, thread_name_prefix="first-scene")
        self._shown = with_one_thread.submit(show)
        with_one_thread.shutdown(wait=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        while not self._shown.done():
            DECODING_PROCESS.interrupt()  # again and again: the next file may be begun only now
            wait([self._shown], timeout=0.1)

    def controller(self) -> SceneController:
        """What holds the scene, once it is shown.

        Raises:
            RelitError: something that the settings or the command line name cannot be used.
        """
        self._shown.result()
        return self._controller
