"""Opens networks in ONNX Runtime, on a proven provider or else on the CPU.

A provider is proven when at least half of the graph's nodes were placed on it and a warm-up run succeeded. Otherwise,
or if it fails later, the CPU is used and the session's report says why. The number of threads is explicit, and threads
never spin, since several networks, OpenCV and BLAS share few cores.
"""

from __future__ import annotations

import logging
import threading
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import NDArray

from relit_camera.base.errors import ConfigError, DeviceError, ModelError
from relit_camera.base.models import provider_names
from relit_camera.base.models.onnx_runtime import (
    TensorSpec,
    node_placement,
    reason,
    runtime_errors,
    runtime_options,
    tensor_specs,
    warm_up,
)

if TYPE_CHECKING:
    import onnxruntime

log = logging.getLogger(__name__)

Model = Path | bytes | Callable[[], bytes]
"""An ONNX model: its file, its bytes, or what makes the bytes. While an accelerator runs the model, its bytes stay in
memory for the CPU to take over; what makes them is called anew then, which suits large models."""

_LOG_FATAL = 4
"""Least severity that ONNX Runtime prints: anything less arrives as an exception or shows in the placement."""


@dataclass(frozen=True)
class SessionOptions:
    """How to run a model.

    Attributes:
        provider: `auto`, `cpu`, `cuda` … (see `base.models.provider_names`).
        threads: threads that work on one operator, at least 1; with 1 it runs in the caller's thread.
        strict: fail rather than fall back to the CPU.
    """

    provider: str = provider_names.AUTO
    threads: int = 1
    strict: bool = False


@dataclass(frozen=True)
class SessionReport:
    """Facts about an open session, for the status and the doctor.

    Attributes:
        name: of the model.
        requested: the provider asked for.
        provider: the provider proven to run it.
        why: why it is not the requested one, or "".
        cure: what to do about that, or "".
        threads: threads that work on one operator.
        placement: number of the graph's nodes on each provider.
        warm_up_ms: time of a run on zeros; None where the model's input shapes are open.
    """

    name: str
    requested: str
    provider: str
    why: str
    cure: str
    threads: int
    placement: Mapping[str, int]
    warm_up_ms: float | None


@dataclass(eq=False)
class Session:
    """An open model, with its inputs and outputs by name. `run` may be called from several threads.

    If an accelerator fails later (its driver is reset, its memory is full), the model runs on the CPU from then on, and
    the report says why.
    """

    report: SessionReport
    inputs: Mapping[str, TensorSpec]
    outputs: Mapping[str, TensorSpec]
    _runtime: onnxruntime.InferenceSession
    _on_cpu: Callable[[str], Session] | None = None
    _change: threading.Lock = field(default_factory=threading.Lock)

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.report.name

    @property
    def requested(self) -> str:
        """The provider asked for."""
        return self.report.requested

    @property
    def provider(self) -> str:
        """The provider proven to run it."""
        return self.report.provider

    @property
    def why(self) -> str:
        """Why `provider` is not the requested one, or ""."""
        return self.report.why

    def run(self, feeds: Mapping[str, NDArray]) -> dict[str, NDArray]:
        """Run on one array for each input; returns all outputs by name.

        Raises:
            ModelError: an input is missing, has another shape or dtype, or the model fails on it.
        """
        try:
            return self._run(feeds)
        except runtime_errors() as error:
            failures: tuple[type[Exception], ...] = (*runtime_errors(), ModelError)
            try:
                return self._run_on_cpu(feeds, reason(error))
            except failures:
                takes = ", ".join(f"{name} {spec}" for name, spec in self.inputs.items())
                raise ModelError(f"model {self.name} failed: {reason(error)}", f"it takes {takes}") from error

    def _run(self, feeds: Mapping[str, NDArray]) -> dict[str, NDArray]:
        values = self._runtime.run(list(self.outputs), feeds)
        return dict(zip(self.outputs, values, strict=True))

    def _run_on_cpu(self, feeds: Mapping[str, NDArray], why: str) -> dict[str, NDArray]:
        """Run on the CPU, and stay there if that succeeds: then the accelerator was at fault and not the inputs."""
        with self._change:
            if self._on_cpu is not None:
                other = self._on_cpu(why)
                result = other._run(feeds)
                log.warning("model %s goes on on the CPU: %s failed: %s", self.name, self.provider, why)
                self.report, self._runtime, self._on_cpu = other.report, other._runtime, None
                return result
        return self._run(feeds)  # it runs on the CPU already


_open_sessions: weakref.WeakSet[Session] = weakref.WeakSet()
_open_sessions_lock = threading.Lock()


def session_report() -> list[SessionReport]:
    """Report every session that is still open, by name."""
    with _open_sessions_lock:
        reports = [session.report for session in _open_sessions]
    return sorted(reports, key=lambda report: report.name)


def require_provider(options: SessionOptions) -> None:
    """Check what can be known of a provider before a model is opened; that it works shows only then.

    Raises:
        ConfigError: there is no such provider.
        DeviceError: strict, and the installed ONNX Runtime was built without it.
    """
    provider = provider_names.choose_provider(options.provider)
    if options.strict:
        try:
            _require_built_in(provider)
        except _ProviderRejectedError as error:
            raise DeviceError(f"models cannot run on {provider}: {error}", _REJECTED_CURE) from error


def open_session(
    model: Model, name: str, options: SessionOptions | None = None, constants: Mapping[str, NDArray] | None = None
) -> Session:
    """Open an ONNX model, prove its provider and warm it up.

    A provider that is missing, does not load, or takes fewer than half of the nodes is replaced by the CPU, and the
    session's `why` says so; with `options.strict` that is an error.

    Args:
        model: the model.
        name: of the model, for messages.
        options: how to run it.
        constants: the model's external tensors by name. As a part of the model's bytes they would be copied thrice,
            and one copy would be kept.

    Raises:
        ModelError: the model is missing, damaged, or cannot run.
        DeviceError: strict, and the provider cannot run the model.
        ConfigError: there is no such provider, or no thread.
    """
    options = options or SessionOptions()
    if options.threads < 1:
        raise ConfigError(f"a model cannot run on {options.threads} threads", "give it at least 1")
    wanted = provider_names.choose_provider(options.provider)
    try:
        session = _open_verified(model, name, wanted, options, constants)
        if wanted != provider_names.CPU and not options.strict:
            session._on_cpu = lambda why: _open_on_provider(
                model,
                name,
                provider_names.CPU,
                options,
                f"{wanted} failed: {why}",
                "restart the camera to try it again",
                constants,
            )
    except _ProviderRejectedError as error:
        if options.strict:
            raise DeviceError(f"model {name} cannot run on {wanted}: {error}", _REJECTED_CURE) from error
        why = f"{wanted}: {error}"
        session = _open_on_provider(model, name, provider_names.CPU, options, why, _REJECTED_CURE, constants)
    with _open_sessions_lock:
        _open_sessions.add(session)
    return session


_REJECTED_CURE = f"`relit doctor` says how to install it; or set the provider to {provider_names.CPU}"


class _ProviderRejectedError(Exception):
    """The provider does not run this model; the message is the reason."""


def _require_built_in(provider: str) -> None:
    if provider not in provider_names.available_providers():
        raise _ProviderRejectedError("the installed ONNX Runtime was built without it")


def _open_verified(
    model: Model, name: str, provider: str, options: SessionOptions, constants: Mapping[str, NDArray] | None
) -> Session:
    _require_built_in(provider)
    missing = provider_names.preload(provider)
    try:
        session = _open_on_provider(model, name, provider, options, constants=constants)
    except _ProviderRejectedError as error:
        raise _ProviderRejectedError(missing or str(error)) from error
    placement = session.report.placement
    nodes, total = placement.get(provider, 0), sum(placement.values())
    if nodes == 0 < total:
        raise _ProviderRejectedError(
            missing or "no node was placed there; its libraries did not load, or it has no device"
        )
    if 2 * nodes < total:
        raise _ProviderRejectedError(f"only {nodes} of {total} nodes were placed there")
    return session


def _open_on_provider(
    model: Model,
    name: str,
    provider: str,
    options: SessionOptions,
    why: str = "",
    cure: str = "",
    constants: Mapping[str, NDArray] | None = None,
) -> Session:
    import onnxruntime
    from onnxruntime.capi.onnxruntime_pybind11_state import InvalidProtobuf, NoModel, NoSuchFile

    source = f"model {name} ({model})" if isinstance(model, Path) else f"model {name}"
    onnxruntime.set_default_logger_severity(_LOG_FATAL)
    try:
        runtime = onnxruntime.InferenceSession(
            model() if callable(model) else model,
            runtime_options(options.threads, constants),
            providers=list(
                dict.fromkeys([provider_names.full_name(provider), provider_names.full_name(provider_names.CPU)])
            ),
            enable_fallback=0,  # falling back is decided here, and reported
        )
        runtime._model_bytes = (
            None  # it would keep the bytes beside its own copy: hundreds of MB for a relighting graph
        )
        inputs, outputs = tensor_specs(runtime.get_inputs()), tensor_specs(runtime.get_outputs())
        warm_up_ms = warm_up(runtime, inputs)
    except NoSuchFile as error:
        raise ModelError(f"{source} does not exist", "check the path, or get it with `relit models pull`") from error
    except (InvalidProtobuf, NoModel) as error:
        raise ModelError(f"{source} is no ONNX model, or a damaged one", "export or pull it again") from error
    except runtime_errors() as error:
        if provider != provider_names.CPU:
            raise _ProviderRejectedError(reason(error)) from error
        raise ModelError(f"{source} cannot be run: {reason(error)}", "export or pull it again") from error
    placement = node_placement(runtime)
    report = SessionReport(name, options.provider, provider, why, cure, options.threads, placement, warm_up_ms)
    return Session(report, inputs, outputs, runtime)
