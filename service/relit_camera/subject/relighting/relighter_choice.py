"""Relighter `auto`, the default: the ONNX graph of floats where a GPU is proven to run it, else integers on the CPU."""

from __future__ import annotations

import logging

from relit_camera.base.models import provider_names
from relit_camera.subject.relighting.onnx_relighter import OnnxBasisRelighter
from relit_camera.subject.relighting.relighter import Relighter, RelighterOptions
from relit_camera.subject.relighting.shared_relighters import shared_relighter
from relit_camera.subject.subject import Subject

log = logging.getLogger(__name__)


def choose_relighter(subject: Subject, options: RelighterOptions) -> Relighter:
    """`onnx-basis` where another provider than the CPU is asked for and proven to run it, else `basis`.

    On the CPU `basis` is the quicker of the two (`relit bench`), so the graph of floats is not even tried there.

    Raises:
        DeviceError: the provider is strict, and cannot run it.
    """
    if provider_names.choose_provider(options.session.provider) == provider_names.CPU:
        return shared_relighter(subject, options)
    relighter = OnnxBasisRelighter(subject, options)
    if relighter.provider != provider_names.CPU:
        return relighter
    log.warning("relighting stays on the CPU: %s", relighter.session.why)
    return shared_relighter(subject, options)
