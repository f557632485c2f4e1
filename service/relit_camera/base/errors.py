"""Every error that Relit Camera raises on purpose.

RelitError                   what happened, and what cures it
├── InputError               the user's input is at fault; the command line exits with 1
│   ├── ConfigError          a setting is unknown, mistyped or out of range
│   ├── NotFoundError        no environment, subject, preset, tracker … of that name
│   ├── ImageError           a picture cannot be read or has the wrong shape or values
│   ├── PanoramaError        a panorama is not 2:1, has NaN or negative light …
│   ├── LightsError          an .lp file, or the pictures that it names, are wrong
│   ├── SubjectError         a .relit file is damaged or of another version
│   ├── VideoError           a video cannot be read, is truncated, or shows no face
│   ├── CaptureError         what a capture needs is not in its pictures: no flash, no mirror ball …
│   ├── TrackError           a recorded track does not fit
│   └── ModelError           a model is missing, has the wrong hash, or breaks its contract
├── DeviceError              a camera, virtual camera or provider is missing or in use
├── PortInUseError           another program listens there
└── StorageError             a file could not be written (disk full, no permission)

The command line and the API only print them: the cure is decided where the error is known.
"""

from __future__ import annotations


class RelitError(Exception):
    """Something a person can cure.

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
    """The user's input is at fault."""


class ConfigError(InputError):
    """A setting is unknown, mistyped or out of range."""


class NotFoundError(InputError):
    """Nothing of that name is stored."""


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
    """What a capture needs is not in its pictures."""


class TrackError(InputError):
    """A recorded track is damaged or does not fit the video or the subject."""


class ModelError(InputError):
    """A model is missing, has the wrong hash, or breaks its contract."""


class DeviceError(RelitError):
    """A camera, a virtual camera or an execution provider is missing or in use."""


class PortInUseError(RelitError):
    """Another program listens on the port."""


class StorageError(RelitError):
    """A file could not be written."""
