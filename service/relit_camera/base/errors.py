"""Every error that Relit Camera raises on purpose.

RelitError                       what is wrong, and what cures it
├── InputError                   the user's input is wrong; the command line exits with 1, the API answers 422
│   ├── ConfigError              a setting is unknown, mistyped or out of range
│   ├── NotFoundError            no environment, subject, preset, tracker … of that name
│   ├── ImageError               a picture cannot be read or has the wrong shape or values
│   ├── PanoramaError            a panorama is not 2:1, or has NaN or negative light …
│   ├── LightsError              an .lp file, or the pictures that it names, are wrong
│   ├── SubjectError             a .relit file is damaged or of another version
│   ├── VideoError               a video cannot be read, is truncated, or shows no face
│   ├── CaptureError             something a capture needs is not in its pictures: no flash, no mirror ball …
│   ├── TrackError               a recorded track does not fit
│   └── ModelError               a model is missing, has the wrong hash, or breaks its contract
│       └── DownloadError        no host gives a model's file as it was tested
├── DeviceError                  a camera, virtual camera or provider is missing or in use
│   ├── KeeperLostError          the process that holds the virtual camera has ended, or there can be none
│   └── UnsupportedByDriverError the device's driver is too old for what it is asked
├── PortInUseError               another program listens on the port
├── StorageError                 a file cannot be written (disk full, no permission)
├── PluginError                  a plug-in of another package fails: its author can mend it
├── PipelineHangError            a frame took so long that its thread was given up
├── WorkerError                  work in a process of its own died, took too long or was canceled
├── ConflictError                API: the thing is in use, built in, or has that name already (409)
│   └── UnlitNotAllowedError     the picture as filmed would be published, which nobody has allowed
├── PreconditionFailedError      API: the scene is no longer the one that the request was made for (412)
├── TooLargeError                API: the request's body is too large (413)
├── ForbiddenError               API: the request came from another site (403)
└── NotReadyError                API: the camera cannot answer that now (503)

RuntimeError
└── IllegalTransitionError       a fault of the program: a source went to a state that it may not go to

The command line and the API only print `what` and `cure`: the code that knows the error writes both.
"""

from __future__ import annotations


class RelitError(Exception):
    """An error that a person can cure.

    Attributes:
        what: one clause saying what is wrong, with the value and the place.
        cure: one clause saying what to do about it.
    """

    def __init__(self, what: str, cure: str = "") -> None:
        super().__init__(what)
        self.what = what
        self.cure = cure

    def __str__(self) -> str:
        return f"{self.what}; {self.cure}" if self.cure else self.what


class InputError(RelitError):
    """The user's input is wrong."""


class ConfigError(InputError):
    """A setting is unknown, mistyped or out of range."""


class NotFoundError(InputError):
    """Nothing has that name: no stored file, and no plug-in."""


class ImageError(InputError):
    """A picture cannot be read, or has the wrong shape or values."""


class PanoramaError(InputError):
    """A panorama cannot be used as light."""


class LightsError(InputError):
    """An .lp file, or the pictures that it names, are wrong."""


class SubjectError(InputError):
    """A .relit file is damaged or of another version."""


class VideoError(InputError):
    """A video cannot be read, is truncated, or shows no face."""


class CaptureError(InputError):
    """Something that a capture needs is not in its pictures."""


class TrackError(InputError):
    """A recorded track is damaged or does not fit the video or the subject."""


class ModelError(InputError):
    """A model is missing, has the wrong hash, or breaks its contract."""


class DownloadError(ModelError):
    """No host gives the file as it was tested.

    Attributes:
        reasons: one for each host, such as "no connection to example.org".
    """

    def __init__(self, what: str, cure: str = "", reasons: tuple[str, ...] = ()) -> None:
        super().__init__(what, cure)
        self.reasons = reasons


class DeviceError(RelitError):
    """A camera, a virtual camera or an execution provider is missing or in use."""


class KeeperLostError(DeviceError):
    """The process that holds the virtual camera for the camera has ended, or there can be none."""


class UnsupportedByDriverError(DeviceError):
    """The device's driver is too old for what it is asked, or another one than expected."""


class PortInUseError(RelitError):
    """Another program listens on the port."""


class StorageError(RelitError):
    """A file could not be written."""


class PluginError(RelitError):
    """A plug-in of another package fails in a way that only its author can mend."""


class PipelineHangError(RelitError):
    """A frame took so long in the pipeline that its thread was given up."""


class WorkerError(RelitError):
    """Work in a process of its own died, took too long, or was canceled."""


class ConflictError(RelitError):
    """What the request names is in use, built in, or exists already."""


class UnlitNotAllowedError(ConflictError):
    """The picture as filmed would be published, which nobody has allowed."""


class PreconditionFailedError(RelitError):
    """The scene has changed since the request was made."""


class TooLargeError(RelitError):
    """The request's body is larger than the API takes."""


class ForbiddenError(RelitError):
    """The request came from another site."""


class NotReadyError(RelitError):
    """The camera cannot answer the request now."""


class IllegalTransitionError(RuntimeError):
    """A source went to a state that it may not go to from its present one: a fault of the program."""
