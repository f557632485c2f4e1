"""Plug-ins by name: what a package, ours included, announces under an entry-point group, opened from a setting's text.

https://packaging.python.org/en/latest/specifications/entry-points/
"""

from __future__ import annotations

import logging
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, EntryPoints, distributions, entry_points
from typing import Any, Generic, TypeVar

from relit_camera.base.errors import ConfigError, InputError, NotFoundError, PluginError, RelitError

log = logging.getLogger(__name__)

OWN_PACKAGE = "relit-camera"
GROUP_PREFIX = "relit_camera."
"""How the names of all groups begin."""
Factory = TypeVar("Factory")


@lru_cache(maxsize=1)
def _selection_on(path: tuple[str, ...]) -> Callable[..., EntryPoints]:
    """What selects among the entry points of all packages on a search path: to read those of a hundred takes 10 ms."""
    found: Any = entry_points()  # of another type in Python 3.11
    select: Callable[..., EntryPoints] = found.select
    return select


@dataclass(frozen=True)
class PluginGroup(Generic[Factory]):
    """All plug-ins of one kind. `Factory` is what each is: a class or function that makes the object.

    Attributes:
        group: the entry-point group, such as `relit_camera.trackers`.
        kind: one plug-in in words, such as `tracker`, for messages.
        with_argument: names of those built in that take an argument; the others that are built in take none. What
            plug-ins of other packages take they check themselves.
    """

    group: str
    kind: str
    with_argument: tuple[str, ...] = ()

    def names(self) -> list[str]:
        """List the names of all that are installed, sorted."""
        return sorted(self._announced().names)

    def has(self, text: str) -> bool:
        """Whether `NAME` or `NAME:ARGUMENT` names one that is installed."""
        return bool(self._announced().select(name=text.partition(":")[0]))

    def load(self, text: str) -> tuple[Factory, str]:
        """Import what `NAME` or `NAME:ARGUMENT` names; returns it and the argument, empty where there is none.

        What it returns for a plug-in of another package raises PluginError, which names the package, for everything but
        a `RelitError` that the plug-in raises when it is called.

        Raises:
            NotFoundError: none of that name is installed.
            ConfigError: two packages announce that name, or the plug-in cannot be imported.
            InputError: it is built in, and takes no argument.
        """
        name, _, argument = text.partition(":")
        point = self._entry_point(name)
        is_ours = _package(point) == OWN_PACKAGE
        if is_ours and name not in self.with_argument:
            require_no_argument(self.kind, name, argument)
        try:
            loaded: Any = point.load()
        except Exception as error:  # a package of somebody else's may fail in any way
            raise ConfigError(
                f"{self.kind} '{name}' of the package {_package(point)} cannot be loaded: {_one_line(error)}",
                "update or uninstall that package",
            ) from error
        return loaded if is_ours else self._guarded(loaded, point), argument

    def _announced(self) -> EntryPoints:
        """Those that were installed when one was first asked for."""
        return _selection_on(tuple(sys.path))(group=self.group)

    def _entry_point(self, name: str) -> EntryPoint:
        points = list(self._announced().select(name=name))
        if not points:
            raise NotFoundError(f"no {self.kind} is called '{name}'", f"there are: {', '.join(self.names())}")
        if len(points) > 1:
            packages = ", ".join(sorted(_package(point) for point in points))
            raise ConfigError(f"several packages have a {self.kind} '{name}': {packages}", "uninstall all but one")
        return points[0]

    def _guarded(self, factory: Callable[..., Any], point: EntryPoint) -> Any:
        """The factory of another package, whose faults are told to be that package's."""

        def make(*args: Any, **options: Any) -> Any:
            try:
                return factory(*args, **options)
            except RelitError:
                raise
            except Exception as error:
                log.debug("%s '%s' has failed", self.kind, point.name, exc_info=error)
                raise PluginError(
                    f"{self.kind} '{point.name}' of the package {_package(point)} cannot be opened: {_one_line(error)}",
                    "tell its author, with the traceback that --log-level debug shows; or choose another",
                ) from error

        return make


def require_no_argument(kind: str, name: str, argument: str) -> None:
    """For plug-ins that take no argument.

    Raises:
        InputError: there is one.
    """
    if argument:
        raise InputError(f"{kind} {name} takes no argument, and got '{argument}'", f"name it '{name}'")


def package_at_fault(error: BaseException) -> str | None:
    """The package of a plug-in, not ours, whose code was running when the error was raised; None if there is none.

    It is found by the error's traceback. What our code makes of a plug-in's wrong result cannot be told from a fault of
    ours, and gives None.
    """
    authors = {
        point.module.partition(".")[0]: distribution.name
        for distribution in distributions()
        for point in distribution.entry_points
        if point.group.startswith(GROUP_PREFIX) and distribution.name != OWN_PACKAGE
    }
    modules = [frame.f_globals.get("__name__", "") for frame, _ in traceback.walk_tb(error.__traceback__)]
    found = (authors.get(module.partition(".")[0]) for module in reversed(modules))
    return next((package for package in found if package is not None), None)


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist else "unknown"


def _one_line(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
