"""On-demand mode, wired: who reads the virtual camera decides whether the webcam is open."""

from __future__ import annotations

import sys
from collections.abc import Callable

from relit_camera.errors import ConfigError
from relit_camera.stream.demand.demand import Demand
from relit_camera.stream.demand.source import OnDemandSource
from relit_camera.stream.demand.watch import ReaderWatch
from relit_camera.stream.sinks.base import Sink
from relit_camera.stream.sources.base import Source


class OnDemand:
    """Watches a sink for readers: a virtual camera by its node; a file always wants pictures, `null` never does.

    Attributes:
        source: to be read in place of the plain one.
    """

    def __init__(self, first: Source, make: Callable[[], Source], sink: Sink) -> None:
        """Wire the parts; `first` and `make` are `OnDemandSource`'s.

        Raises:
            ConfigError: this system does not tell who reads a virtual camera.
        """
        kind = sink.describe().kind
        self._watch = ReaderWatch(lambda: sink.describe().id) if kind == "camera" else None
        if self._watch is not None and not sys.platform.startswith("linux"):
            raise ConfigError(
                "source.on_demand: only Linux tells who reads a virtual camera", "leave it out on this system"
            )
        self._demand = Demand(self._watch.anybody if self._watch else lambda: kind == "file")
        self.source = OnDemandSource(first, make, self._demand.wanted)

    def note_viewer(self) -> None:
        """Somebody asks for a preview or a snapshot: that counts as reading."""
        self._demand.note_viewer()

    def close(self) -> None:
        """End what watches. The source belongs to whoever reads it."""
        if self._watch is not None:
            self._watch.close()
