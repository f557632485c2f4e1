"""The tracker `recorded:PATH`: plays back a `relit track` file, so that nothing need be downloaded."""

from __future__ import annotations

from pathlib import Path

from relit_camera.errors import TrackError
from relit_camera.face.state import FaceState
from relit_camera.face.track_file import read_track
from relit_camera.face.trackers import TrackerOptions
from relit_camera.space.images import Frame


class RecordedTracker:
    """Answers with the recorded state of the frame's index; beyond the end it begins again, as a looped file does."""

    name = "recorded"

    def __init__(self, options: TrackerOptions) -> None:
        """Read the track that the options' argument names.

        Raises:
            TrackError: no path is given, or the file is no usable track.
        """
        if not options.argument:
            raise TrackError("tracker recorded has no track", "name it as recorded:PATH")
        self._path = Path(options.argument)
        self._track = read_track(self._path)
        self.scheme = self._track.scheme

    def track(self, frame: Frame) -> FaceState:
        """Give the state recorded for `frame.index`.

        Raises:
            TrackError: the track was made on pictures of another size.
        """
        if frame.size != self._track.size:
            wanted, got = ("x".join(map(str, size)) for size in (self._track.size, frame.size))
            raise TrackError(f"track {self._path} is of {wanted} pictures, and this one is {got}", "track this video")
        return self._track.state(frame.index)

    def reset(self) -> None:
        """Nothing is kept between frames."""
