"""The sink whose virtual camera a keeper holds: pictures are laid into shared memory, and the keeper shows them."""

from __future__ import annotations

import logging
import mmap
import os
import sys
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_runtime_path

from relit_camera.base.config.settings import OutputSettings
from relit_camera.base.errors import DeviceError, KeeperLostError
from relit_camera.base.images.color import rgb_to_i420
from relit_camera.base.images.image_types import DisplayImage, check_image
from relit_camera.base.images.resize import crop_to_fill
from relit_camera.devices.keeper.keeper import PICTURE_SLOTS
from relit_camera.devices.keeper.keeper_process import VERSION
from relit_camera.devices.keeper.keeper_socket import shared_memory
from relit_camera.devices.keeper.kept_output import I420, OutputOptions, picture_bytes
from relit_camera.devices.keeper.sink_keeper import SinkKeeper
from relit_camera.devices.sinks.sink import Readers, Sink, SinkInfo
from relit_camera.devices.sinks.sink_factory import SINKS, device_node

log = logging.getLogger(__name__)

KEPT_SINKS = {"camera": "", "pipewire": "pipewire"}
"""The sinks that a keeper holds, by name: what tells its keeper from others, which never changes. Device nodes, which
the keeper opens without any library, come beside them."""
MAX_STARTS, FORGIVEN_AFTER = 3, 2000
"""Keepers that are started for one camera; then it does without. The count begins anew where one has shown so many
pictures."""


@dataclass(frozen=True)
class KeeperParts:
    """What the camera gives its keeper.

    Attributes:
        placeholder: draws what is shown when the last picture no longer is, uint8 sRGB RGB, of a (width, height).
        may_repeat: whether the picture that is being published may be shown again without the camera.
    """

    placeholder: Callable[[tuple[int, int]], DisplayImage]
    may_repeat: Callable[[], bool] = lambda: True


def kept_options(settings: OutputSettings) -> OutputOptions | None:
    """What a keeper is to hold for these settings; None where there is to be none.

    Raises:
        InputError: the sink takes no argument.
    """
    if not sys.platform.startswith("linux") or not settings.keep_s:
        return None
    size = settings.width, settings.height
    if _sink_name(settings) in KEPT_SINKS:
        opener, argument = SINKS.load(settings.sink)
        sink = f"{opener.__module__}:{opener.__qualname__}"
        return OutputOptions(size, settings.fps, settings.label, sink=sink, argument=argument)
    node = device_node(settings.sink)
    return OutputOptions(size, settings.fps, settings.label, node) if node else None


def keeper_for(settings: OutputSettings, version: str = VERSION) -> SinkKeeper | None:
    """The keeper of the virtual camera that the settings name; None where there is to be none.

    Args:
        settings: of the output.
        version: of this program, as the keeper is told.

    Raises:
        InputError: the sink takes no argument.
    """
    options = kept_options(settings)
    if options is None:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a session without a folder for this: one below /tmp is as good
        folder = user_runtime_path("relit-camera", appauthor=False)
    return SinkKeeper(options, settings.keep_s, folder, version, KEPT_SINKS.get(_sink_name(settings), ""))


class KeptSink:
    """Gives its pictures to a keeper, and waits until each is shown: there is no queue.

    A keeper that ends is replaced at once. Where that fails again and again, pictures are published without one.
    """

    def __init__(self, keeper: SinkKeeper, parts: KeeperParts, open_directly: Callable[[], Sink]) -> None:
        """Open the virtual camera.

        Args:
            keeper: holds it.
            parts: what the keeper shows where it may not show the last picture.
            open_directly: opens it without a keeper.

        Raises:
            DeviceError: there is no such device, or it is in use; the cure is the command to run.
        """
        self._keeper, self._parts, self._open_directly = keeper, parts, open_directly
        self._direct: Sink | None = None
        self._slots: list[NDArray[np.uint8]] = []
        self._image: DisplayImage | None = None
        self._slot = self._shown = 0
        self._may_repeat = False
        self._layout, self._size = I420, (0, 0)
        self._info = SinkInfo("camera", "", self._size)
        self._opened()

    def write(self, image: DisplayImage) -> None:
        """Show a picture, uint8 sRGB RGB (height, width, 3).

        Raises:
            DeviceError: the virtual camera is gone or in use.
            ImageError: the array is no picture.
        """
        check_image(image, np.uint8, "picture to show")
        if not self._slots and self._direct is None:
            self._opened()
        try:
            self._show(image)
        except KeeperLostError as error:
            log.warning("%s: another is started", error.what)
            self._slots, self._shown = [], 0
            self._opened()
            self._show(image)

    def describe(self) -> SinkInfo:
        """Facts about the sink."""
        return self._direct.describe() if self._direct is not None else self._info

    def close(self) -> None:
        """Close the virtual camera, or with `SinkKeeper.hands_over` leave it to the next camera. May be repeated."""
        if self._direct is not None:
            self._direct.close()
        self._slots = []
        self._keeper.leave()
        self._keeper.starts = 0  # what failed was not the keeper

    def _opened(self) -> None:
        try:
            if self._keeper.starts >= MAX_STARTS and not self._keeper.connected:
                raise KeeperLostError("the keeper has ended again and again", "please report it")
            self._open()
        except KeeperLostError as error:
            what = f"the virtual camera is published without a keeper: {error.what}"
            log.warning("%s; %s", what, error.cure)
            self._keeper.end()
            self._direct = self._open_directly()
            self._keeper.report(DeviceError(what, error.cure))

    def _open(self) -> None:
        held = self._keeper.greet()
        self._info, self._layout = _info(held["info"]), str(held["layout"])
        width, height = held["size"]
        self._size = size = width, height
        layout = self._layout
        shape = (size[1] * 3 // 2, size[0]) if layout == I420 else (size[1], size[0], 3)
        try:
            descriptor = shared_memory((PICTURE_SLOTS + 1) * picture_bytes(size, layout))
            try:
                memory = np.frombuffer(mmap.mmap(descriptor, 0), np.uint8)
                slots = [part.reshape(shape) for part in np.split(memory, PICTURE_SLOTS + 1)]
                self._lay(self._parts.placeholder(size), slots[PICTURE_SLOTS])
                self._keeper.share(descriptor)
            finally:
                os.close(descriptor)
        except OSError as error:
            raise KeeperLostError(
                f"no memory can be shared with it: {error.strerror}", "close other programs"
            ) from error
        self._slots, self._image = slots, None

    def _show(self, image: DisplayImage) -> None:
        if self._direct is not None:
            self._direct.write(image)
            return
        # Pictures are never modified once they are shown, so the same object is the same picture, and lies there.
        if image is not self._image:
            slot = (self._slot + 1) % PICTURE_SLOTS
            fitting = image if image.shape[1::-1] == self._size else crop_to_fill(image, self._size)
            self._lay(np.ascontiguousarray(fitting), self._slots[slot])
            self._slot, self._image = slot, image
        # Not where it was different when the picture was made, which may have been before the last one was shown.
        before, self._may_repeat = self._may_repeat, self._parts.may_repeat()
        try:
            answer = self._keeper.show(self._slot, before and self._may_repeat)
        except KeeperLostError:
            raise
        except DeviceError:
            self._slots = []  # the keeper has closed it: the next picture opens it again
            self._info = replace(self._info, pipewire=None, trouble=None)
            raise
        self._shown += 1
        if self._shown == FORGIVEN_AFTER:
            self._keeper.starts = 1
        if "info" in answer:
            self._info = _info(answer["info"])

    def _lay(self, image: DisplayImage, slot: NDArray[np.uint8]) -> None:
        if self._layout == I420:
            rgb_to_i420(image, slot)
        else:
            slot[:] = image


def _sink_name(settings: OutputSettings) -> str:
    return settings.sink.partition(":")[0]


def _info(fields: Mapping[str, Any]) -> SinkInfo:
    """What `KeptOutput.describe` has made JSON of."""
    width, height = fields["size"]
    readers, trouble = fields["pipewire"], fields["trouble"]
    return SinkInfo(
        str(fields["kind"]),
        str(fields["id"]),
        (width, height),
        None if readers is None else Readers(readers[0], tuple(readers[1])),
        None if trouble is None else DeviceError(*trouble),
    )
