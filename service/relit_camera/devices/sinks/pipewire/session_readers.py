"""The programs that read a node, from the registry of the PipeWire session."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from relit_camera.devices.sinks.pipewire import pipewire_library as library
from relit_camera.devices.sinks.sink import Readers

MAX_NAMES, MAX_NAME_LENGTH = 32, 100
"""Of the readers that are named: what a program calls itself is its own affair, and is told with pictures."""
NODE, LINK = "PipeWire:Interface:Node", "PipeWire:Interface:Link"
Objects = Mapping[int, tuple[str, Mapping[str, str]]]
"""Nodes and links of a session by their number: type and properties."""


class SessionReaders:
    """Follows who is linked to which node. The session tells what comes and goes; nothing is asked for."""

    def __init__(self, pipewire: Any, core: int) -> None:
        """Begin to listen; the loop is locked.

        Args:
            pipewire: the library.
            core: the connection to the session.
        """
        self._pipewire = pipewire
        self._found: dict[int, tuple[str, dict[str, str]]] = {}
        """Nodes and links of the session by their number: type and properties."""
        self._hook = library.Hook()
        self._events = library.RegistryEvents(
            come=library.GLOBAL(self._on_come), gone=library.GLOBAL_REMOVED(self._on_gone)
        )
        self._registry = library.get_registry(core)
        if self._registry:
            library.listen_to_registry(self._registry, self._hook, self._events)

    def of_node(self, node: int) -> Readers:
        """Those that are linked to a node, by its number. From any thread."""
        return readers_of_node(dict(self._found), node)

    def close(self) -> None:
        """Listen no longer; the loop is stopped."""
        if self._registry:
            self._pipewire.pw_proxy_destroy(self._registry)
        self._registry = None

    def _on_come(self, _: Any, identifier: int, __: int, kind: bytes, ___: int, properties: Any) -> None:
        name = kind.decode(errors="replace")
        if name in (NODE, LINK):
            self._found[identifier] = name, library.texts_of(properties)

    def _on_gone(self, _: Any, identifier: int) -> None:
        self._found.pop(identifier, None)


def readers_of_node(objects: Objects, node: int) -> Readers:
    """The programs that are linked to a node: how many links there are, and each name once.

    There are `MAX_NAMES` of them at most, cut at `MAX_NAME_LENGTH` characters.
    """
    links = (properties for kind, properties in objects.values() if kind == LINK)
    readers = [link.get("link.input.node", "") for link in links if link.get("link.output.node") == str(node)]
    # The node's own name: a client that came through the portal bears the portal's.
    nodes = [objects.get(int(reader), (NODE, {}))[1] for reader in readers if reader.isdigit()]
    names = (each.get("application.name") or each.get("node.name") or "a program" for each in nodes)
    return Readers(len(nodes), tuple(dict.fromkeys(name[:MAX_NAME_LENGTH] for name in names))[:MAX_NAMES])
