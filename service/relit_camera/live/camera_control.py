"""The interface through which the API controls the running camera."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

from relit_camera.base.images.image_types import DisplayImage
from relit_camera.base.storage.upload import Upload
from relit_camera.face.framing.framing import Framing
from relit_camera.live.scene.scene_controller import SceneController
from relit_camera.live.status.camera_status import CameraStatus
from relit_camera.live.status.capture_status import CaptureStatus
from relit_camera.live.status.desk_status import DeskCaptureStatus, DeskPlace
from relit_camera.live.status.event_hub import EventHub
from relit_camera.live.status.expression_status import ExpressionCaptureStatus
from relit_camera.live.status.film_status import FilmCaptureStatus, FilmOptions
from relit_camera.live.status.replay_status import ReplayStatus
from relit_camera.live.status.setup_status import Check, DeviceList, ModelPullStatus, SourceStatus, TrackerChoice


class CaptureControl(Protocol):
    """A capture that runs beside the camera. `app.captures.live_capture.LiveCapture` implements it."""

    def status(self) -> CaptureStatus:
        """How far the last capture is."""
        ...

    def start(self, name: str) -> CaptureStatus:
        """Begin to capture a subject that is stored under `name`, and shown once it is.

        Raises:
            ConflictError: a capture runs, or a better subject has that name.
            InputError: the name is not allowed.
        """
        ...

    def cancel(self) -> CaptureStatus:
        """End the capture that runs, if one does; nothing is stored then."""
        ...


class DeskCaptureControl(Protocol):
    """A desk capture, whose patterns a page shows. `app.captures.desk.desk_filming.DeskFilming` implements it."""

    def status(self) -> DeskCaptureStatus:
        """How far the last capture is."""
        ...

    def start(self, name: str, place: DeskPlace) -> DeskCaptureStatus:
        """Begin to capture a subject that is stored under `name`, and shown once it is.

        Raises:
            ConflictError: a capture runs, or a better subject has that name.
            InputError: the name is not allowed, or the place cannot be.
        """
        ...

    def page_shows(self, step: int) -> DeskCaptureStatus:
        """Note which step the page shows; it must be called several times a second."""
        ...

    def cancel(self) -> DeskCaptureStatus:
        """End the capture that runs, if one does; nothing is stored then."""
        ...


class SetupControl(Protocol):
    """What the camera needs of the machine, and its choice of devices. `app.setup.camera_setup` implements it."""

    def checks(self) -> tuple[Check, ...]:
        """What the camera needs, and whether it is there; at most some seconds old. Takes a second or two."""
        ...

    def devices(self) -> DeviceList:
        """The cameras of this machine, now."""
        ...

    def source(self) -> SourceStatus:
        """Where live frames come from."""
        ...

    def change_source(
        self, device: str | None = None, width: int | None = None, height: int | None = None, fps: float | None = None
    ) -> SourceStatus:
        """Take frames from another webcam, or in another size or rate; what is not given stays. Takes some seconds.

        Raises:
            NotFoundError: there is no such webcam.
            ConflictError: it gives no frames, or another change is under way. The source is as before.
        """
        ...

    def tracker(self) -> TrackerChoice:
        """Which tracker follows the face."""
        ...

    def change_tracker(self, name: str) -> TrackerChoice:
        """Let another tracker follow the face, from one of the next frames on.

        Raises:
            NotFoundError: there is none of that name.
            ConflictError: its models are missing. The tracker is as before.
        """
        ...

    def models(self) -> ModelPullStatus:
        """Which public models are missing, and how far their pull is."""
        ...

    def pull_models(self) -> ModelPullStatus:
        """Begin to pull the public models; the event `models` tells each step.

        Raises:
            ConflictError: a pull is under way.
        """
        ...

    def cancel_models(self) -> ModelPullStatus:
        """End the pull that is under way, if one is. Models that are stored already stay."""
        ...

    def want_framing(self, wanted: bool) -> None:
        """Judge the framing for some seconds from now on, or no longer; the event `framing` tells it."""
        ...

    def framing(self) -> Framing:
        """How well the person sits before the webcam now. Waits for up to two seconds, if it was not wanted before.

        Raises:
            NotReadyError: no frames come, or the models that find a face are missing.
        """
        ...


class FilmCaptureControl(Protocol):
    """A capture from a film that was sent. `app.captures.film.film_processing.FilmProcessing` implements it."""

    def status(self) -> FilmCaptureStatus:
        """How far the last capture is."""
        ...

    def receive(self, name: str, file_name: str, options: FilmOptions) -> AbstractContextManager[Upload]:
        """Give where to write a film to, which replaces an older one; the capture begins when the context ends.

        Raises:
            ConflictError: a capture from a film runs, a better subject has that name, the upload was canceled, or
                another process has the folder of films.
            InputError: a name is not allowed, or no film has such a file name.
            StorageError: the film cannot be written.
        """
        ...

    def resume(self, options: FilmOptions | None = None) -> FilmCaptureStatus:
        """Go on with the film that is there; with other options than before the work begins anew.

        Raises:
            ConflictError: there is no film, its capture runs, or another process has the folder of films.
        """
        ...

    def cancel(self, forget: bool = False) -> FilmCaptureStatus:
        """End the capture that runs, if one does; nothing is stored then. With `forget` the film is deleted.

        Raises:
            ConflictError: another process has the folder of films, and `forget` was asked for.
        """
        ...

    def subject_renamed(self, name: str, new_name: str) -> None:
        """Let the report of a subject's film bear its new name."""
        ...

    def subject_removed(self, name: str) -> None:
        """Delete the report of a subject's film, and its pictures."""
        ...

    def picture(self, name: str) -> bytes:
        """A JPEG file of the last report.

        Raises:
            NotFoundError: there is none of that name.
        """
        ...


class ExpressionCaptureControl(Protocol):
    """Expression stills for a stored subject. `app.captures.expressions.expression_job.ExpressionJob` implements it."""

    def status(self) -> ExpressionCaptureStatus:
        """How far the last capture is."""
        ...

    def start(self, subject: str | None = None) -> ExpressionCaptureStatus:
        """Begin to film the person before the webcam, for the subject that is shown, if none is named.

        Raises:
            NotFoundError: there is no stored subject of that name.
            ConflictError: a capture runs, nobody is shown, or the subject is not stored.
        """
        ...

    def receive(self, subject: str | None, file_name: str) -> AbstractContextManager[Upload]:
        """Give where to write a video to; stills are made of it when the context ends.

        Raises:
            NotFoundError, ConflictError: as `start`; or the upload was canceled, or another process has the folder.
            InputError: no video has such a file name.
            StorageError: the video cannot be written.
        """
        ...

    def cancel(self) -> ExpressionCaptureStatus:
        """End the capture that runs, if one does; the subject is as before then."""
        ...


class ReplayControl(Protocol):
    """Videos that were sent to be relit, one at a time. `app.replay.replay_jobs.ReplayJobs` implements it."""

    def all(self) -> list[ReplayStatus]:
        """Those that are stored, by name, and one that runs, failed or was canceled."""
        ...

    def status(self, name: str) -> ReplayStatus:
        """How far the replay of that name is.

        Raises:
            NotFoundError: there is none of that name.
        """
        ...

    def receive(self, name: str, file_name: str) -> AbstractContextManager[Upload]:
        """Give where to write a video to; it is relit, as the present scene says, when the context ends.

        Raises:
            ConflictError: one is being relit, there is one of that name, nobody is shown who could be relit, the upload
                was canceled, or another process has the folder of replays.
            InputError: a name is not allowed, or no video has such a file name.
            StorageError: the video cannot be written.
        """
        ...

    def video(self, name: str) -> Path:
        """The file of a relit video.

        Raises:
            ConflictError: it is not done.
            NotFoundError: there is none of that name.
        """
        ...

    def remove(self, name: str) -> None:
        """End a replay that runs, or delete its video.

        Raises:
            NotFoundError: there is none of that name.
            StorageError: it cannot be deleted.
        """
        ...


class CameraControl(Protocol):
    """The running camera as the API sees it. `app.camera_service.CameraService` implements it."""

    scene_controller: SceneController
    events: EventHub

    @property
    def demo_subject(self) -> Path:
        """The file of the person who is shipped with the program."""
        ...

    @property
    def instant_capture(self) -> CaptureControl:
        """The capture that makes a subject of the person before the camera."""
        ...

    @property
    def desk_capture(self) -> DeskCaptureControl:
        """The capture by the light of the person's own screen."""
        ...

    @property
    def setup(self) -> SetupControl:
        """What the camera needs of the machine, and its choice of devices."""
        ...

    @property
    def film_capture(self) -> FilmCaptureControl:
        """The capture from a film that is sent."""
        ...

    @property
    def expression_capture(self) -> ExpressionCaptureControl:
        """The capture that adds expression stills to a subject."""
        ...

    @property
    def replays(self) -> ReplayControl:
        """Videos that are sent to be relit."""
        ...

    def status(self) -> CameraStatus:
        """The camera's present state; cheap enough for several calls a second."""
        ...

    def picture(self, after: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        """The newest published picture and its count if that is above `after`, waiting up to `timeout_s` for one.

        The picture is uint8 sRGB RGB (height, width, 3), not mirrored. None when time is up or the camera stops.
        """
        ...

    def filmed_picture(self, after: int, timeout_s: float) -> tuple[int, DisplayImage] | None:
        """The newest frame as filmed, of the output's size, for the panel alone: it is never published.

        Frames are kept only while somebody asks; count and waiting are as in `picture`.
        """
        ...

    def reset_neutral_pose(self) -> None:
        """Take the present head pose as neutral, from the next frame in which the face is found."""
        ...

    def stopping(self) -> bool:
        """Whether the camera is shutting down: long answers must end."""
        ...
