"""What the API's connection timeouts use of uvicorn beyond its public interface."""

from __future__ import annotations

import asyncio
from importlib.metadata import requires, version

import uvicorn
from packaging.requirements import Requirement
from uvicorn.protocols.http.flow_control import FlowControl
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle
from uvicorn.server import ServerState

from relit_camera.api.server.connection_timeouts import TimeoutHttpProtocol


async def nothing(scope: object, receive: object, send: object) -> None:
    """An application that is never called."""


def test_uvicorn_is_held_to_one_series() -> None:
    """A new series may change the class that is extended: it comes with a commit that runs these tests."""
    [pinned] = [Requirement(text) for text in requires("relit-camera") or [] if Requirement(text).name == "uvicorn"]
    major, minor = version("uvicorn").split(".")[:2]
    assert pinned.specifier.contains(version("uvicorn"))
    assert not pinned.specifier.contains(f"{major}.{int(minor) + 1}.0")


def test_the_parts_that_are_used_are_there() -> None:
    loop = asyncio.new_event_loop()
    protocol = TimeoutHttpProtocol(uvicorn.Config(nothing, log_config=None), ServerState(), {}, loop)
    loop.close()
    assert {"loop", "transport", "flow", "cycle"} <= vars(protocol).keys()
    assert protocol.cycle is None, "no request has begun"
    assert {"response_complete", "more_body"} <= set(RequestResponseCycle.__init__.__code__.co_names)
    assert "read_paused" in FlowControl.__init__.__code__.co_names
    for overridden in ("connection_made", "connection_lost", "data_received", "on_response_complete"):
        assert overridden in vars(H11Protocol)
    for overridden in ("pause_writing", "resume_writing"):
        assert overridden in vars(H11Protocol)


def test_the_server_uses_the_extended_class() -> None:
    config = uvicorn.Config(nothing, http=TimeoutHttpProtocol, log_config=None)
    config.load()
    assert config.http_protocol_class is TimeoutHttpProtocol
