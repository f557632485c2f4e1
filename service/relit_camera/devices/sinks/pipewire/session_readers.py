"""Names of the programs that read a node, from the registry of the PipeWire session."""

from __future__ import annotations

from typing import Any

from relit_camera.devices.sinks.pipewire import pipewire_library as library

NODE, LINK = "PipeWire:Interface:Node", "PipeWire:Interface:Link"


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

    def names(self, node: int) -> tuple[str, ...]:
        """Of the programs that are linked to a node, by its number; one for each link. From any thread."""
        found = dict(self._found)
        links = (properties for kind, properties in found.values() if kind == LINK)
        readers = [link.get("link.input.node", "") for link in links if link.get("link.output.node") == str(node)]
        # The node's own name: a client that came through the portal bears the portal's.
        nodes = (found.get(int(reader), (NODE, {}))[1] for reader in readers if reader.isdigit())
        return tuple(each.get("application.name") or each.get("node.name") or "a program" for each in nodes)

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
