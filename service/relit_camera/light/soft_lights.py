"""Light as a sum of soft lights all around, and their amounts fitted to what they make visible.

Some eighty lights, each as wide as the distance between two, are what a face's shading can tell apart. They take the
place of 2048 texels wherever light is estimated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relit_camera.base.rotations import Rotation
from relit_camera.light.directions import fibonacci_directions, texel_directions

WHOLE_EXCHANGES, ROUNDING = 3, 1e-12
"""Of the non-negative fit: exchanges of all wrong amounts without progress before one at a time is exchanged, and the
share of the right-hand side by which a slope may be wrong."""


@dataclass(frozen=True)
class SoftLights:
    """Soft lights spread evenly over the sphere.

    Attributes:
        count: number of them.
        sharpness: k of a light's exp(k (cos − 1)): with 12 half its value at 20°, about the spacing of 80 lights.
    """

    count: int = 80
    sharpness: float = 12.0

    def maps(self, rotation: Rotation | None = None) -> NDArray[np.float32]:
        """Their radiance, fixed in the room, in the frame of a head under `rotation`: (2048, count) float32."""
        toward = fibonacci_directions(self.count)
        if rotation is not None:
            toward = toward @ rotation.as_matrix()
        texels = texel_directions().reshape(-1, 3).astype(np.float32)
        exponent = texels @ (self.sharpness * toward.T).astype(np.float32)
        exponent -= np.float32(self.sharpness)
        return np.exp(exponent, out=exponent)


def regularized_nnls(
    design: NDArray[np.floating],
    values: NDArray[np.floating],
    weight: NDArray[np.floating] | NDArray[np.bool_],
    prior: NDArray[np.floating],
    ridge: float,
) -> NDArray[np.float64]:
    """Solve argmin_{x ≥ 0} Σ w (A x − b)² + λ |x − prior|², where λ is `ridge` of the normal matrix's mean diagonal.

    By block principal pivoting on the normal matrix, which is small (Kim and Park, SIAM J. Sci. Comput. 33 (2011)),
    from the amounts that were positive in `prior`: two or three solutions where the light has hardly changed. SciPy's
    solver would cost the camera 13 MB.
    """
    weighted = design * weight.astype(design.dtype)[:, None]
    normal = (weighted.T @ design).astype(np.float64)
    strength = ridge * max(float(np.trace(normal)) / len(normal), 1e-12)
    normal[np.diag_indices_from(normal)] += strength
    right = weighted.T @ values + strength * prior
    positive, solution = prior > 0, np.zeros(len(normal))
    fewest, chances = len(normal) + 1, WHOLE_EXCHANGES
    while True:
        solution[~positive] = 0
        solution[positive] = np.linalg.solve(normal[np.ix_(positive, positive)], right[positive])
        slope = normal @ solution - right
        wrong = np.flatnonzero(np.where(positive, solution < 0, slope < -ROUNDING * np.abs(right).max()))
        if not len(wrong):
            return solution
        if len(wrong) < fewest:
            fewest, chances = len(wrong), WHOLE_EXCHANGES
        else:
            chances -= 1
        # All at once may go in circles; one at a time, always the last, does not (Murty's rule).
        exchanged = wrong if chances > 0 else wrong[-1:]
        positive[exchanged] = ~positive[exchanged]
