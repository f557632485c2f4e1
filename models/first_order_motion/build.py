"""Builds `first_order_motion.onnx`: landmarks before and after → a dense backward flow.

The thesis's reenactor (first-order motion model, Siarohin et al. 2019) as closed arithmetic instead of a trained
network: round each landmark the motion is an affine map, found by weighted least squares over its neighbours (there:
regressed Jacobians), and the dense flow is their softly weighted mixture together with a still background.

    python models/first_order_motion/build.py            writes the packaged graph
    python models/first_order_motion/build.py --check    fails if the packaged graph is not what this script builds
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from onnx import TensorProto, checker, helper, numpy_helper

OUT = Path(__file__).resolve().parents[2] / "service/relit_camera/live/reenactment/first_order_motion.onnx"
OPSET = 17
IR_VERSION = 9

NEIGHBOURHOOD = 1.2
"""Neighbours count by a Gaussian of this many of the point's own radii."""
RIGIDITY = 0.05
"""Ridge toward plain translation, as a share of the neighbours' spread: keeps lone points from shearing."""
STIFFNESS = 2e-3
"""The same in absolute terms: within about a twentieth of the eye distance motion is a shift, so that two lids that
meet do not squeeze the eyeball between them."""
BACKGROUND = 1e-3
"""Weight of the still background, in the unit of `strength`."""


class _Graph:
    """Collects nodes; `add` returns the name of the node's one output."""

    def __init__(self) -> None:
        self.nodes: list = []
        self.constants: list = []

    def add(self, op: str, *inputs: str, out: str | None = None, **attributes: object) -> str:
        name = out or f"t{len(self.nodes)}"
        self.nodes.append(helper.make_node(op, list(inputs), [name], **attributes))
        return name

    def constant(self, value: object, dtype: type = np.float32) -> str:
        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value, dtype=dtype), name))
        return name


def build() -> bytes:
    """The serialised model.

    Inputs, all float32, positions in any one unit (the product uses eye distances):
        source (K, 2): landmark positions in the still picture.
        target (K, 2): where each of them must come to lie.
        centre (K, 2): where in the moved picture its influence is centred; its target, except beside a slit.
        radius (K, 1): reach of each landmark.
        strength (K, 1): weight of each landmark at its centre; 1 / radius² lets fine ones win near themselves.
        grid (G, 2): positions in the moved picture at which the flow is wanted.

    Output:
        flow (G, 2): moved(x) = still(x + flow(x)).
    """
    g = _Graph()
    radius_squared = g.add("Mul", "radius", "radius")

    weights = _gaussian(g, "centre", "centre", g.add("Mul", radius_squared, g.constant(2 * NEIGHBOURHOOD**2)), 1)
    source_moments = _moments(g, weights, "source", "target")
    target_moments = _moments(g, weights, "target", "target")
    spread = g.add("Mul", g.add("Add", target_moments[0], target_moments[3]), g.constant(RIGIDITY))
    spread = g.add("Add", spread, g.constant(STIFFNESS))
    for moments in (source_moments, target_moments):
        for i in (0, 3):
            moments[i] = g.add("Add", moments[i], spread)
    affine = _times_inverse(g, source_moments, target_moments)

    # still(x) sits at  s + A (x − t)  =  A x + (s − A t); the flow is that minus x.
    tx, ty = _columns(g, "target")
    sx, sy = _columns(g, "source")
    one = g.constant(1.0)
    offset_x = g.add("Sub", sx, g.add("Add", g.add("Mul", affine[0], tx), g.add("Mul", affine[1], ty)))
    offset_y = g.add("Sub", sy, g.add("Add", g.add("Mul", affine[2], tx), g.add("Mul", affine[3], ty)))
    rows = [g.add("Sub", affine[0], one), affine[1], offset_x, affine[2], g.add("Sub", affine[3], one), offset_y]
    table = g.add("Concat", *rows, g.add("Add", g.add("Mul", tx, g.constant(0.0)), one), axis=1)

    # −|x − t|² / 2r² as one product of (x, y, |x|², 1) and a row a landmark: the grid is large, its passes are dear.
    gx, gy = _columns(g, "grid")
    cx, cy = _columns(g, "centre")
    half = g.add("Div", g.constant(0.5), radius_squared)
    square = g.add("Add", g.add("Mul", cx, cx), g.add("Mul", cy, cy))
    rows = [g.add("Div", cx, radius_squared), g.add("Div", cy, radius_squared), g.add("Neg", half)]
    exponents = g.add("Concat", *rows, g.add("Neg", g.add("Mul", square, half)), axis=1)
    grid_square = g.add("Add", g.add("Mul", gx, gx), g.add("Mul", gy, gy))
    ones = g.add("Add", g.add("Mul", gx, g.constant(0.0)), one)
    positions = g.add("Concat", gx, gy, grid_square, ones, axis=1)
    mixture = g.add("Exp", g.add("MatMul", positions, g.add("Transpose", exponents, perm=[1, 0])))
    mixed = g.add("MatMul", mixture, g.add("Mul", table, "strength"))
    parts = g.add("Split", mixed, g.constant([1] * 7, np.int64), out="part0", axis=1)
    g.nodes[-1].output.extend([f"part{i}" for i in range(1, 7)])
    total = g.add("Add", "part6", g.constant(BACKGROUND))
    flow_x = g.add("Add", g.add("Add", g.add("Mul", parts, gx), g.add("Mul", "part1", gy)), "part2")
    flow_y = g.add("Add", g.add("Add", g.add("Mul", "part3", gx), g.add("Mul", "part4", gy)), "part5")
    g.add("Div", g.add("Concat", flow_x, flow_y, axis=1), total, out="flow")

    def port(name: str, rows: str, columns: int) -> object:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, [rows, columns])

    points = [port(name, "K", 2) for name in ("source", "target", "centre")]
    inputs = [*points, port("radius", "K", 1), port("strength", "K", 1), port("grid", "G", 2)]
    graph = helper.make_graph(g.nodes, "first_order_motion", inputs, [port("flow", "G", 2)], g.constants)
    model = helper.make_model(
        graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION, producer_name="relit-camera"
    )
    checker.check_model(model, full_check=True)
    return model.SerializeToString(deterministic=True)


def _columns(g: _Graph, points: str) -> tuple[str, str]:
    first = g.add("Gather", points, g.constant([0], np.int64), axis=1)
    return first, g.add("Gather", points, g.constant([1], np.int64), axis=1)


def _gaussian(g: _Graph, rows: str, columns: str, two_variances: str, axis: int) -> str:
    """exp(−|row − column|² / two_variances) as (rows, columns), from coordinate differences (no cancellation)."""
    squares = []
    for row, column in zip(_columns(g, rows), _columns(g, columns), strict=True):
        difference = g.add("Sub", row, g.add("Transpose", column, perm=[1, 0]))
        squares.append(g.add("Mul", difference, difference))
    return g.add("Exp", g.add("Neg", g.add("Div", g.add("Add", *squares), two_variances)))


def _moments(g: _Graph, weights: str, left: str, right: str) -> list[str]:
    """Σ_j w_ij (left_j − left_i)(right_j − right_i)ᵀ for each i, as four (K, 1) tensors, row by row."""
    result = []
    for a in _columns(g, left):
        across = g.add("Sub", g.add("Transpose", a, perm=[1, 0]), a)
        weighted = g.add("Mul", weights, across)
        for b in _columns(g, right):
            down = g.add("Sub", g.add("Transpose", b, perm=[1, 0]), b)
            product = g.add("Mul", weighted, down)
            result.append(g.add("ReduceSum", product, g.constant([1], np.int64), keepdims=1))
    return result


def _times_inverse(g: _Graph, m: list[str], n: list[str]) -> list[str]:
    """M · N⁻¹ for 2 x 2 matrices held as four (K, 1) tensors each."""
    determinant = g.add("Sub", g.add("Mul", n[0], n[3]), g.add("Mul", n[1], n[2]))

    def entry(a: str, b: str, c: str, d: str) -> str:
        return g.add("Div", g.add("Sub", g.add("Mul", a, b), g.add("Mul", c, d)), determinant)

    return [
        entry(m[0], n[3], m[1], n[2]),
        entry(m[1], n[0], m[0], n[1]),
        entry(m[2], n[3], m[3], n[2]),
        entry(m[3], n[0], m[2], n[1]),
    ]


def main() -> int:
    """Write or check the packaged graph."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true")
    data = build()
    if not parser.parse_args().check:
        OUT.write_bytes(data)
        return 0
    if OUT.read_bytes() != data:
        print(f"{OUT} is not what this script builds; run it without --check", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
