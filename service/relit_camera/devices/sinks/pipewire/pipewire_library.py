"""The C library libpipewire-0.3, as far as a camera needs it: functions, structures and constants, by ctypes.

Only what the library keeps stable is used: exported functions, and structures that its headers show to programs
(pipewire/stream.h, pipewire/core.h, spa/buffer/buffer.h, spa/buffer/meta.h, spa/utils/hook.h, spa/utils/dict.h).
Methods of remote objects are C source in the headers, and are called here through their tables.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Mapping
from ctypes import (
    CFUNCTYPE,
    POINTER,
    Structure,
    c_char_p,
    c_int,
    c_int32,
    c_int64,
    c_size_t,
    c_uint32,
    c_uint64,
    c_void_p,
)
from enum import IntEnum
from functools import cache
from typing import Any

from relit_camera.base.errors import DeviceError

LIBRARY = "libpipewire-0.3.so.0"
ANY_ID = 0xFFFFFFFF
DIRECTION_OUTPUT = 1
FLAG_MAP_BUFFERS, FLAG_DRIVER = 1 << 2, 1 << 3
"""The buffers are mapped into memory; and this node, as the source of pictures, says when there is one."""
META_HEADER = 1
"""The metadata of a buffer that holds number and time of its picture."""


class StreamState(IntEnum):
    """States of a stream."""

    ERROR = -1
    UNCONNECTED = 0
    CONNECTING = 1
    PAUSED = 2
    STREAMING = 3


class Dict(Structure):
    """Texts by their keys (struct spa_dict)."""


class DictItem(Structure):
    """One text of a `Dict` and its key."""

    _fields_ = (("key", c_char_p), ("value", c_char_p))


Dict._fields_ = (("flags", c_uint32), ("n_items", c_uint32), ("items", POINTER(DictItem)))


class Hook(Structure):
    """A listener's place in a list of the library's (struct spa_hook)."""

    _fields_ = tuple((name, c_void_p) for name in ("next", "previous", "functions", "data", "removed", "private"))


class Interface(Structure):
    """How the methods of a remote object are called (struct spa_interface)."""

    _fields_ = (("type", c_char_p), ("version", c_uint32), ("functions", c_void_p), ("data", c_void_p))


class Meta(Structure):
    """A piece of a buffer's metadata."""

    _fields_ = (("type", c_uint32), ("size", c_uint32), ("data", c_void_p))


class MetaHeader(Structure):
    """Number and time of a picture: nanoseconds of the monotonic clock."""

    _fields_ = (
        ("flags", c_uint32),
        ("offset", c_uint32),
        ("pts", c_int64),
        ("dts_offset", c_int64),
        ("sequence", c_uint64),
    )


class Chunk(Structure):
    """Which part of a buffer's memory holds a picture."""

    _fields_ = (("offset", c_uint32), ("size", c_uint32), ("stride", c_int32), ("flags", c_int32))


class Data(Structure):
    """A buffer's memory."""

    _fields_ = (
        ("type", c_uint32),
        ("flags", c_uint32),
        ("fd", c_int64),
        ("mapoffset", c_uint32),
        ("maxsize", c_uint32),
        ("data", c_void_p),
        ("chunk", POINTER(Chunk)),
    )


class SpaBuffer(Structure):
    """A buffer's memory and metadata."""

    _fields_ = (
        ("n_metas", c_uint32),
        ("n_datas", c_uint32),
        ("metas", POINTER(Meta)),
        ("datas", POINTER(Data)),
    )


class StreamBuffer(Structure):
    """The beginning of a buffer as a stream gives it (struct pw_buffer)."""

    _fields_ = (("buffer", POINTER(SpaBuffer)), ("user_data", c_void_p), ("size", c_uint64))


STATE_CHANGED = CFUNCTYPE(None, c_void_p, c_int, c_int, c_char_p)
PARAM_CHANGED = CFUNCTYPE(None, c_void_p, c_uint32, c_void_p)


class StreamEvents(Structure):
    """What a stream calls (struct pw_stream_events, version 0)."""

    _fields_ = (
        ("version", c_uint32),
        ("destroy", c_void_p),
        ("state_changed", STATE_CHANGED),
        ("control_info", c_void_p),
        ("io_changed", c_void_p),
        ("param_changed", PARAM_CHANGED),
        ("add_buffer", c_void_p),
        ("remove_buffer", c_void_p),
        ("process", c_void_p),
        ("drained", c_void_p),
    )


GLOBAL = CFUNCTYPE(None, c_void_p, c_uint32, c_uint32, c_char_p, c_uint32, POINTER(Dict))
GLOBAL_REMOVED = CFUNCTYPE(None, c_void_p, c_uint32)


class RegistryEvents(Structure):
    """What a registry calls: something has come, or gone (struct pw_registry_events, version 0)."""

    _fields_ = (("version", c_uint32), ("come", GLOBAL), ("gone", GLOBAL_REMOVED))


class _CoreMethods(Structure):
    """struct pw_core_methods, as far as it is used."""

    _fields_ = (
        ("version", c_uint32),
        *((name, c_void_p) for name in ("add_listener", "hello", "sync", "pong", "error")),
        ("get_registry", CFUNCTYPE(c_void_p, c_void_p, c_uint32, c_size_t)),
    )


class _RegistryMethods(Structure):
    """struct pw_registry_methods, as far as it is used."""

    _fields_ = (
        ("version", c_uint32),
        ("add_listener", CFUNCTYPE(c_int, c_void_p, POINTER(Hook), POINTER(RegistryEvents), c_void_p)),
    )


_FUNCTIONS: Mapping[str, tuple[Any, tuple[Any, ...]]] = {
    "pw_init": (None, (c_void_p, c_void_p)),
    "pw_get_library_version": (c_char_p, ()),
    "pw_properties_new_dict": (c_void_p, (POINTER(Dict),)),
    "pw_thread_loop_new": (c_void_p, (c_char_p, c_void_p)),
    "pw_thread_loop_get_loop": (c_void_p, (c_void_p,)),
    "pw_thread_loop_start": (c_int, (c_void_p,)),
    "pw_thread_loop_stop": (None, (c_void_p,)),
    "pw_thread_loop_lock": (None, (c_void_p,)),
    "pw_thread_loop_unlock": (None, (c_void_p,)),
    "pw_thread_loop_destroy": (None, (c_void_p,)),
    "pw_context_new": (c_void_p, (c_void_p, c_void_p, c_size_t)),
    "pw_context_connect": (c_void_p, (c_void_p, c_void_p, c_size_t)),
    "pw_context_destroy": (None, (c_void_p,)),
    "pw_core_disconnect": (c_int, (c_void_p,)),
    "pw_proxy_destroy": (None, (c_void_p,)),
    "pw_stream_new": (c_void_p, (c_void_p, c_char_p, c_void_p)),
    "pw_stream_add_listener": (None, (c_void_p, POINTER(Hook), POINTER(StreamEvents), c_void_p)),
    "pw_stream_connect": (c_int, (c_void_p, c_int, c_uint32, c_int, POINTER(c_char_p), c_uint32)),
    "pw_stream_update_params": (c_int, (c_void_p, POINTER(c_char_p), c_uint32)),
    "pw_stream_get_state": (c_int, (c_void_p, POINTER(c_char_p))),
    "pw_stream_get_node_id": (c_uint32, (c_void_p,)),
    "pw_stream_dequeue_buffer": (POINTER(StreamBuffer), (c_void_p,)),
    "pw_stream_queue_buffer": (c_int, (c_void_p, POINTER(StreamBuffer))),
    "pw_stream_trigger_process": (c_int, (c_void_p,)),
    "pw_stream_destroy": (None, (c_void_p,)),
}
"""Name → (type of the result, types of the arguments)."""


@cache
def load_pipewire() -> Any:
    """The library, initialized. Its functions release Python's global lock while they run.

    Raises:
        DeviceError: it is not installed, or too old.
    """
    if not sys.platform.startswith("linux"):
        raise DeviceError("only Linux has PipeWire", "choose another sink")
    cure = "install PipeWire 0.3.48 or newer (Debian and Ubuntu: sudo apt install pipewire wireplumber)"
    try:
        library = ctypes.CDLL(LIBRARY, use_errno=True)
        for name, (result, arguments) in _FUNCTIONS.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise DeviceError(f"PipeWire's library cannot be used: {error}", cure) from error
    library.pw_init(None, None)
    return library


def dictionary(texts: Mapping[str, str]) -> Dict:
    """Texts as the library takes them."""
    items = (DictItem * len(texts))(*(DictItem(key.encode(), text.encode()) for key, text in texts.items()))
    return Dict(0, len(texts), items)


def texts_of(found: Any) -> dict[str, str]:
    """The texts of a pointer to a `Dict`, which may be null."""
    if not found:
        return {}
    given = found.contents
    return {
        item.key.decode(errors="replace"): (item.value or b"").decode(errors="replace")
        for item in given.items[: given.n_items]
    }


def params_array(params: list[bytes]) -> Any:
    """Encoded PODs as the library takes them: an array of pointers. The bytes must be held as long as it is used."""
    return (c_char_p * len(params))(*params)


def get_registry(core: int) -> int | None:
    """The registry of a core: it tells what there is in the session. None where the session refuses."""
    interface = Interface.from_address(core)
    methods = _CoreMethods.from_address(interface.functions)
    registry: int | None = methods.get_registry(interface.data, 3, 0)
    return registry


def listen_to_registry(registry: int, hook: Hook, events: RegistryEvents) -> None:
    """Let a registry call `events`, for what is there and what comes and goes. Hook and events must be kept."""
    interface = Interface.from_address(registry)
    methods = _RegistryMethods.from_address(interface.functions)
    methods.add_listener(interface.data, ctypes.byref(hook), ctypes.byref(events), None)
