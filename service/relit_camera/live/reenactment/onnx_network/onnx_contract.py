"""What an ONNX reenactor must take and give (docs/reenactors.md), checked when it is loaded and in every answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.errors import ModelError
from relit_camera.base.models.onnx_runtime import TensorSpec
from relit_camera.base.models.session_with_fallback import Session, SessionOptions, open_session

SOURCE, DRIVING, DRIVING_INITIAL = "source", "driving", "driving_initial"
FLOW, PREDICTION, ALPHA = "flow", "prediction", "alpha"
DEFAULT_SIDE = 256
"""Side of the crops for a network that takes any size."""
OVERSHOOT = 0.1
"""Values may leave 0..1 by this much, as resampling makes them; they are clipped."""
MAX_REST_FLOW = 0.25
"""Mean distance from the unmoved grid, in half crop sides, that the flow of a face at rest may have. A network that
gives displacements instead of positions has 0.77."""
CURE = "export it as docs/reenactors.md says"

CropImage = NDArray[np.uint8]
"""(side, side, 3) uint8 sRGB."""


@dataclass(frozen=True)
class NetworkOutput:
    """What the network makes of one frame: a flow, or else a picture.

    Attributes:
        flow: (rows, columns, 2) float32 positions in the source crop, −1..1 from the middle of its first pixel to that
            of its last; or None.
        picture: (rows, columns, 3) float32 sRGB code values in 0..1; or None.
        alpha: (rows, columns) float32 in 0..1 of `picture`; or None.
    """

    flow: NDArray[np.float32] | None = None
    picture: NDArray[np.float32] | None = None
    alpha: NDArray[np.float32] | None = None


class ReenactorNetwork:
    """An ONNX reenactor that keeps the contract.

    Attributes:
        side: of the square crops that it takes, in pixels.
        relative: whether it wants the driving face at neutral too, and moves the source as the driver moved since.
        gives_flow: whether it gives a flow rather than a picture.
    """

    def __init__(self, path: Path, options: SessionOptions) -> None:
        """Open the network and check the names, ranks, sizes and types that it declares.

        Raises:
            ModelError: it is missing, damaged, or breaks the contract; names what was found and what is expected.
        """
        self._name = path.name
        self._session = open_session(path, path.stem, options)
        self.side = self._checked_side(self._session)
        self.relative = DRIVING_INITIAL in self._session.inputs
        self.gives_flow = FLOW in self._session.outputs
        if not self.gives_flow and PREDICTION not in self._session.outputs:
            found = ", ".join(self._session.outputs)
            raise self._broken(f"its outputs are {found}; one must be '{FLOW}' or '{PREDICTION}'")

    def check_at_rest(self, source: CropImage) -> None:
        """Run it on a face that is driven by itself: the answer must be of the right kind, and hardly move anything.

        Raises:
            ModelError: as `answer`, or the flow holds displacements, or positions in other units.
        """
        flow = self.run(source, source, source).flow
        if flow is None:
            return
        away = float(np.linalg.norm(flow - identity_grid(*flow.shape[:2]), axis=2).mean())
        if away > MAX_REST_FLOW:
            low, high = flow.min(), flow.max()
            raise self._broken(
                f"driven by the source itself, '{FLOW}' has values {low:.2f}..{high:.2f}, {away:.2f} from the unmoved "
                "grid on average; expected are positions in the source from -1 to 1, not displacements or pixels"
            )

    def run(self, source: CropImage, driving: CropImage, initial: CropImage) -> NetworkOutput:
        """Run it on three crops (side, side, 3) uint8 sRGB; `initial` is the driving face at neutral.

        Raises:
            ModelError: it fails, or an output has another rank, size or type, holds NaN, or leaves its range.
        """
        crops = {SOURCE: source, DRIVING: driving, DRIVING_INITIAL: initial}
        outputs = self._session.run({name: _to_tensor(crops[name]) for name in self._session.inputs})
        if self.gives_flow:
            flow = self._checked(outputs, FLOW)
            if flow.ndim != 4 or flow.shape[0] != 1 or flow.shape[3] != 2 or min(flow.shape[1:3]) < 2:
                raise self._broken(f"output '{FLOW}' has shape {list(flow.shape)}; expected [1, rows, columns, 2]")
            return NetworkOutput(flow=flow[0])
        picture = self._checked_picture(outputs, PREDICTION, 3)
        alpha = self._checked_picture(outputs, ALPHA, 1)[..., 0] if ALPHA in outputs else None
        if alpha is not None and alpha.shape != picture.shape[:2]:
            shapes = (
                f"'{ALPHA}' is {alpha.shape[1]}x{alpha.shape[0]}, '{PREDICTION}' {picture.shape[1]}x{picture.shape[0]}"
            )
            raise self._broken(f"outputs differ in size: {shapes}")
        return NetworkOutput(picture=picture, alpha=alpha)

    def _checked_side(self, session: Session) -> int:
        names = {SOURCE, DRIVING, DRIVING_INITIAL}
        missing = [name for name in (SOURCE, DRIVING) if name not in session.inputs]
        unknown = [name for name in session.inputs if name not in names]
        if missing or unknown:
            found = ", ".join(session.inputs) or "none"
            raise self._broken(
                f"its inputs are {found}; expected are {SOURCE}, {DRIVING} and perhaps {DRIVING_INITIAL}"
            )
        for name, spec in session.inputs.items():
            if not _takes_crops(spec):
                raise self._broken(f"input '{name}' is {spec}; expected float32 [1, 3, side, side], fixed or open")
        fixed = {size for spec in session.inputs.values() for size in spec.shape[2:] if size is not None}
        if len(fixed) > 1:
            raise self._broken(f"its inputs have the sides {', '.join(map(str, sorted(fixed)))}; expected is one")
        return fixed.pop() if fixed else DEFAULT_SIDE

    def _checked_picture(self, outputs: Mapping[str, NDArray], name: str, channels: int) -> NDArray[np.float32]:
        """The output as (rows, columns, channels), clipped to 0..1."""
        values = self._checked(outputs, name)
        if values.ndim != 4 or values.shape[:2] != (1, channels):
            raise self._broken(
                f"output '{name}' has shape {list(values.shape)}; expected [1, {channels}, rows, columns]"
            )
        low, high = float(values.min()), float(values.max())
        if low < -OVERSHOOT or high > 1 + OVERSHOOT:
            raise self._broken(f"output '{name}' has values {low:.2f}..{high:.2f}; expected 0..1")
        return np.asarray(np.clip(values[0].transpose(1, 2, 0), 0, 1), dtype=np.float32)

    def _checked(self, outputs: Mapping[str, NDArray], name: str) -> NDArray[np.float32]:
        values: NDArray = outputs[name]
        if values.dtype != np.float32 or values.size == 0:
            raise self._broken(f"output '{name}' is {values.dtype} {list(values.shape)}; expected float32 of rank 4")
        if not np.isfinite(values).all():
            bad = np.count_nonzero(~np.isfinite(values))
            raise self._broken(f"output '{name}' has {bad} values of {values.size} that are no numbers")
        return values

    def _broken(self, what: str) -> ModelError:
        return ModelError(f"reenactor {self._name}: {what}", CURE)


def identity_grid(rows: int, columns: int) -> NDArray[np.float32]:
    """The flow (rows, columns, 2) that moves nothing: each node's own position."""
    x, y = np.linspace(-1, 1, columns, dtype=np.float32), np.linspace(-1, 1, rows, dtype=np.float32)
    return np.stack(np.meshgrid(x, y), axis=-1)


def _takes_crops(spec: TensorSpec) -> bool:
    if spec.dtype != np.float32 or len(spec.shape) != 4:
        return False
    batch, channels, height, width = spec.shape
    square = height is None or width is None or height == width >= 8
    return batch in (1, None) and channels in (3, None) and square


def _to_tensor(crop: CropImage) -> NDArray[np.float32]:
    """(1, 3, side, side) float32 in 0..1."""
    return np.ascontiguousarray(crop.transpose(2, 0, 1)[None], dtype=np.float32) / np.float32(255)
