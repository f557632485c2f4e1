"""Who reads a node of a PipeWire session, by the session's objects."""

from __future__ import annotations

import json

from relit_camera.devices.keeper.keeper_socket import MAX_MESSAGE_BYTES
from relit_camera.devices.sinks.pipewire.session_readers import LINK, NODE, Objects, readers_of_node
from relit_camera.devices.sinks.sink import Readers

CAMERA = 40


def session(*names: str) -> Objects:
    """A camera, which programs of these names read, each through one link."""
    nodes = {100 + at: (NODE, {"application.name": name}) for at, name in enumerate(names)}
    links = {
        1000 + at: (LINK, {"link.output.node": str(CAMERA), "link.input.node": str(100 + at)})
        for at in range(len(names))
    }
    return {CAMERA: (NODE, {"node.name": "Relit Camera"}), **nodes, **links}


def test_each_is_counted_and_each_name_is_told_once() -> None:
    assert readers_of_node(session("firefox", "OBS", "firefox"), CAMERA) == Readers(3, ("firefox", "OBS"))
    assert readers_of_node(session("firefox"), CAMERA + 1) == Readers(0)


def test_one_without_a_name_is_told_too() -> None:
    assert readers_of_node(session(""), CAMERA) == Readers(1, ("a program",))


def test_no_client_can_make_the_keeper_s_answer_too_long() -> None:
    # A character beyond the basic plane takes twelve bytes of JSON.
    found = readers_of_node(session(*(f"{at:03}" + 66_000 * "\N{VIDEO CAMERA}" for at in range(300))), CAMERA)
    assert found.count == 300
    assert found.names[0] == "000" + 97 * "\N{VIDEO CAMERA}"
    assert len(json.dumps([found.count, found.names])) < MAX_MESSAGE_BYTES * 3 // 4
