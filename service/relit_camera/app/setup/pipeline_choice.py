"""Which pipeline the camera runs: its tracker and the size of its pictures, both changed while it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

from relit_camera.app.wiring import make_pipeline, make_tracker
from relit_camera.base.config.settings import RelitSettings
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.face.face_state import Tracker
from relit_camera.live.pipeline import Pipeline, RenderedFrame


class PipelineChoice:
    """Makes the pipelines of a running camera. Any thread may change what the next one is.

    Attributes:
        size: width and height of the pictures that a pipeline makes: the output's, or smaller.
        replace_pipeline: puts another pipeline in the place of the one at work, made by its argument, or by `make`
            where that is None; to be set before anything is changed.
    """

    def __init__(
        self,
        settings: RelitSettings,
        tracker: Tracker | None,
        new_tracker: Callable[[], Tracker] | None = None,
    ) -> None:
        """Begin with a tracker.

        Args:
            settings: of this run.
            tracker: of the first pipeline; None where its models are missing.
            new_tracker: makes another like it; the same again if not given.
        """
        self._settings, self._tracker, self._new_tracker = settings, tracker, new_tracker
        self._output_size = self.size = (settings.output.width, settings.output.height)
        self.replace_pipeline: Callable[[Callable[[], Pipeline] | None], None] = lambda make: None

    @property
    def tracker_name(self) -> str:
        """Name of the tracker at work, or of the one that is waited for."""
        return self._tracker.name if self._tracker is not None else self._settings.tracker.name

    def first(self) -> Pipeline | None:
        """The first pipeline; None where its tracker is missing."""
        return None if self._tracker is None else make_pipeline(self._settings, self._tracker, self.size)

    def make(self) -> Pipeline:
        """Another pipeline, with a tracker of its own, since the one before may still be at work.

        Raises:
            ModelError: the tracker's models are missing.
        """
        if self._new_tracker is not None:
            self._tracker = self._new_tracker()
        assert self._tracker is not None
        return make_pipeline(self._settings, self._tracker, self.size)

    def fit(self, rendered: RenderedFrame) -> RenderedFrame:
        """A rendered picture in the output's size."""
        if rendered.image.shape[1::-1] == self._output_size:
            return rendered
        return replace(rendered, image=crop_to_fill(rendered.image, self._output_size))

    def use_tracker(self, tracker: Tracker, settings: RelitSettings) -> None:
        """Let a tracker follow the face from the next frame on, and others that are made from these settings later."""
        self._tracker, self._settings, self._new_tracker = tracker, settings, partial(make_tracker, settings)
        self.replace_pipeline(lambda: make_pipeline(settings, tracker, self.size))

    def use_source_size(self, width: int, height: int) -> None:
        """Make pictures of the output's shape, no larger than the source's frames, which are asked for in this size."""
        output_width, output_height = self._output_size
        part = min(1.0, max(width / output_width, height / output_height))
        size = (2 * round(part * output_width / 2), 2 * round(part * output_height / 2))
        if size != self.size:
            self.size = size
            self.restart()

    def restart(self) -> None:
        """Put a new pipeline in the place of the one at work: what was missing may be there."""
        self.replace_pipeline(None)
