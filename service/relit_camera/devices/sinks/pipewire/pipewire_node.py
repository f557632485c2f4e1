"""A node of the user's PipeWire session that is a camera: programs find it by its name, and read its pictures.

PipeWire's functions are called with the lock of its loop held; the loop, a thread of the library's, holds it while it
calls back. So neither side waits for the other longer than it takes to copy a picture, and no reader is ever waited
for: where all buffers are with readers, a picture is left out.
"""

from __future__ import annotations

import ctypes
import errno
import logging
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import DeviceError
from relit_camera.base.images.image_types import DisplayImage
from relit_camera.devices.sinks.picture_conversion import I420Converter
from relit_camera.devices.sinks.pipewire import pipewire_library as library
from relit_camera.devices.sinks.pipewire.camera_formats import (
    BGRX,
    I420,
    PARAM_FORMAT,
    PixelLayout,
    buffer_params,
    chosen_layout,
    format_params,
)
from relit_camera.devices.sinks.pipewire.pipewire_library import StreamState, load_pipewire
from relit_camera.devices.sinks.pipewire.session_readers import SessionReaders
from relit_camera.devices.sinks.sink import Readers

log = logging.getLogger(__name__)

NO_SESSION_CURE = "log in to a desktop with PipeWire, or start it: systemctl --user start pipewire wireplumber"


class PipeWireNode:
    """A camera in the session, until it is closed or the session ends.

    Attributes:
        size: width and height of its pictures.
        left_out: pictures that were left out because all buffers were with readers.
    """

    def __init__(self, size: tuple[int, int], fps: float, label: str, convert: I420Converter) -> None:
        """Publish the node.

        Args:
            size: width and height, both even.
            fps: pictures a second, as readers are told.
            label: its name.
            convert: makes I420 of pictures.

        Raises:
            DeviceError: the library is missing, or no session runs.
        """
        self._pipewire = load_pipewire()
        self.size, self.left_out = size, 0
        self._convert = convert
        self._streaming = False
        self._lost = ""
        """Why the session is gone; empty while it is there."""
        self._layout: PixelLayout | None = None
        self._sequence = 0
        self._number = library.ANY_ID
        """The node's number in the session, once it has one."""
        self._loop = self._context = self._core = self._stream = None
        # What the library calls and keeps pointers to lives as long as this object.
        self._events = library.StreamEvents(
            state_changed=library.STATE_CHANGED(self._on_state),
            param_changed=library.PARAM_CHANGED(self._on_param),
        )
        self._hook = library.Hook()
        self._readers: SessionReaders | None = None
        try:
            self._publish(fps, label)
        except BaseException:
            self.close()
            raise

    def send(self, image: DisplayImage) -> None:
        """Give a picture of `size`, uint8 sRGB RGB, to whoever reads; nothing is done where nobody does.

        Raises:
            OSError: the session has ended.
        """
        if self._lost:
            raise OSError(errno.EPIPE, self._lost)
        layout = self._layout
        if not self._streaming or layout is None:
            return
        pixels = self._pixels(image, layout)
        with self._locked():
            if self._streaming and self._layout is layout:
                self._queue(pixels, layout)

    def readers(self) -> Readers:
        """The programs that read it now; may be called from any thread, also while another one closes it."""
        readers = self._readers
        if not self._streaming or readers is None:
            return Readers(0)
        found = readers.of_node(self._number)
        return Readers(max(1, found.count or 0), found.names)  # it streams before the links are told

    def close(self) -> None:
        """Take the camera away. Harmless when repeated."""
        pipewire, self._streaming = self._pipewire, False
        if self._loop is not None:
            pipewire.pw_thread_loop_stop(self._loop)  # from here on nothing is called back
        if self._readers is not None:
            self._readers.close()
        if self._stream is not None:
            pipewire.pw_stream_destroy(self._stream)
        if self._core is not None:
            pipewire.pw_core_disconnect(self._core)
        if self._context is not None:
            pipewire.pw_context_destroy(self._context)
        if self._loop is not None:
            pipewire.pw_thread_loop_destroy(self._loop)
        self._loop = self._context = self._core = self._stream = self._readers = None
        self._streaming, self._lost = False, "it was closed"

    def _publish(self, fps: float, label: str) -> None:
        pipewire = self._pipewire
        self._loop = pipewire.pw_thread_loop_new(b"relit-camera", None)
        if not self._loop or pipewire.pw_thread_loop_start(self._loop) < 0:
            raise _no_session("its loop cannot be started")
        with self._locked():
            client = self._properties({"application.name": "Relit Camera"})
            self._context = pipewire.pw_context_new(pipewire.pw_thread_loop_get_loop(self._loop), client, 0)
            if not self._context:
                raise _no_session("its modules or configuration are missing")
            self._core = pipewire.pw_context_connect(self._context, None, 0)
            if not self._core:
                raise _no_session(os.strerror(ctypes.get_errno()))
            texts = {
                "media.type": "Video",
                "media.category": "Capture",
                "media.class": "Video/Source",
                "media.role": "Camera",
                "node.name": label,
                "node.description": label,
            }
            self._stream = pipewire.pw_stream_new(self._core, label.encode(), self._properties(texts))
            if not self._stream:
                raise _no_session("no stream can be made")
            pipewire.pw_stream_add_listener(self._stream, ctypes.byref(self._hook), ctypes.byref(self._events), None)
            params = format_params(self.size, fps)
            flags = library.FLAG_DRIVER | library.FLAG_MAP_BUFFERS
            result = pipewire.pw_stream_connect(
                self._stream, library.DIRECTION_OUTPUT, library.ANY_ID, flags, library.params_array(params), len(params)
            )
            if result < 0:
                raise _no_session(os.strerror(-result))
            self._readers = SessionReaders(pipewire, self._core)

    def _properties(self, texts: Mapping[str, str]) -> int:
        """Properties, which the function that takes them frees."""
        return int(self._pipewire.pw_properties_new_dict(ctypes.byref(library.dictionary(texts))))

    def _pixels(self, image: DisplayImage, layout: PixelLayout) -> NDArray[np.uint8]:
        if layout is I420:
            return self._convert(image)
        code = cv2.COLOR_RGB2BGRA if layout is BGRX else cv2.COLOR_RGB2YUV_YUY2
        return np.asarray(cv2.cvtColor(image, code), np.uint8)

    def _queue(self, pixels: NDArray[np.uint8], layout: PixelLayout) -> None:
        """Copy a picture into a free buffer, if there is one, and hand it to the readers; the loop is locked."""
        pipewire = self._pipewire
        found = pipewire.pw_stream_dequeue_buffer(self._stream)
        if not found:
            self.left_out += 1
            return
        buffer = found.contents.buffer.contents
        memory = buffer.datas[0]
        chunk = memory.chunk.contents
        fits = memory.data and memory.maxsize >= pixels.nbytes
        if fits:
            ctypes.memmove(memory.data, pixels.ctypes.data, pixels.nbytes)
        chunk.offset, chunk.size, chunk.stride = 0, pixels.nbytes if fits else 0, layout.stride(self.size)
        self._sequence += 1
        for meta in buffer.metas[: buffer.n_metas]:
            if meta.type == library.META_HEADER and meta.size >= ctypes.sizeof(library.MetaHeader):
                header = library.MetaHeader.from_address(meta.data)
                header.flags, header.offset, header.dts_offset = 0, 0, 0
                header.pts, header.sequence = time.monotonic_ns(), self._sequence
        pipewire.pw_stream_queue_buffer(self._stream, found)
        pipewire.pw_stream_trigger_process(self._stream)

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Hold the lock of the library's loop."""
        self._pipewire.pw_thread_loop_lock(self._loop)
        try:
            yield
        finally:
            self._pipewire.pw_thread_loop_unlock(self._loop)

    # Called by the library's thread, with the loop's lock held.

    def _on_state(self, _: Any, old: int, new: int, error: bytes | None) -> None:
        """Note whether anybody reads, and whether the session is there."""
        is_ours = self._pipewire.pw_stream_get_state(self._stream, None) == StreamState.ERROR
        if new == StreamState.ERROR and not is_ours:
            return  # a reader's trouble is told in the same way, and leaves the stream as it is
        self._number = int(self._pipewire.pw_stream_get_node_id(self._stream))
        self._streaming = new == StreamState.STREAMING
        if new in (StreamState.ERROR, StreamState.UNCONNECTED):
            self._lost = (error or b"the session has ended").decode(errors="replace")

    def _on_param(self, _: Any, identifier: int, param: int | None) -> None:
        """Take the layout that a reader has chosen, and ask for buffers that fit it."""
        if identifier != PARAM_FORMAT:
            return
        self._layout = None
        if not param:
            return
        length = 8 + ctypes.c_uint32.from_address(param).value
        with suppress(ValueError):
            self._layout = layout = chosen_layout(ctypes.string_at(param, length), self.size)
            params = buffer_params(layout, self.size)
            self._pipewire.pw_stream_update_params(self._stream, library.params_array(params), len(params))


def _no_session(why: str) -> DeviceError:
    return DeviceError(f"no PipeWire session can be reached: {why}", NO_SESSION_CURE)
