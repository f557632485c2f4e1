"""Plug-ins by name: what a package, ours included, announces under an entry-point group, opened from a setting's text.

https://packaging.python.org/en/latest/specifications/entry-points/
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar

from relit_camera.base.errors import ConfigError, InputError, NotFoundError

Factory = TypeVar("Factory")


@dataclass(frozen=True)
class PluginGroup(Generic[Factory]):
    """All plug-ins of one kind. `Factory` is what each is: a class or function that makes the object.

    Attributes:
        group: the entry-point group, such as `relit_camera.trackers`.
        kind: one plug-in in words, such as `tracker`, for messages.
    """

    group: str
    kind: str

    def names(self) -> list[str]:
        """List the names of all that are installed, sorted."""
        return sorted(entry_points(group=self.group).names)

    def has(self, text: str) -> bool:
        """Whether `NAME` or `NAME:ARGUMENT` names one that is installed."""
        return bool(entry_points(group=self.group, name=text.partition(":")[0]))

    def require(self, text: str) -> None:
        """Check, without importing anything, that `NAME` or `NAME:ARGUMENT` names just one that is installed.

        Raises:
            NotFoundError: none of that name is installed.
            ConfigError: two packages announce that name.
        """
        self._entry_point(text.partition(":")[0])

    def load(self, text: str) -> tuple[Factory, str]:
        """Import what `NAME` or `NAME:ARGUMENT` names; returns it and the argument, empty where there is none.

        Raises:
            NotFoundError: none of that name is installed.
            ConfigError: two packages announce that name, or the plug-in cannot be imported.
        """
        name, _, argument = text.partition(":")
        point = self._entry_point(name)
        try:
            loaded: Any = point.load()
        except Exception as error:  # a package of somebody else's may fail in any way
            raise ConfigError(
                f"{self.kind} '{name}' of the package {_package(point)} cannot be loaded: "
                f"{type(error).__name__}: {error}",
                "update or uninstall that package",
            ) from error
        return loaded, argument

    def _entry_point(self, name: str) -> EntryPoint:
        points = list(entry_points(group=self.group, name=name))
        if not points:
            raise NotFoundError(f"no {self.kind} is called '{name}'", f"there are: {', '.join(self.names())}")
        if len(points) > 1:
            packages = ", ".join(sorted(_package(point) for point in points))
            raise ConfigError(f"several packages have a {self.kind} '{name}': {packages}", "uninstall all but one")
        return points[0]


def require_no_argument(kind: str, name: str, argument: str) -> None:
    """For plug-ins that take no argument.

    Raises:
        InputError: there is one.
    """
    if argument:
        raise InputError(f"{kind} {name} takes no argument, and got '{argument}'", f"name it '{name}'")


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist else "unknown"
