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

LEAST_EXPONENT = -36.0
"""Gaussians of one axis end here, 11 orders of magnitude below the background: processors are slow with the denormal
numbers that the products of lesser ones are."""


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
        columns (N, C), rows (N, R): x and y of the lines of N grids in the moved picture, where the flow is wanted.
        fine_columns (M, D), fine_rows (M, S): of M more grids, with other numbers of lines.

    Outputs:
        flow (N, R, C, 2), fine_flow (M, S, D, 2): moved(x) = still(x + flow(x)).
    """
    g = _Graph()
    radius_squared = g.add("Mul", "radius", "radius")

    weights = _gaussian(g, "centre", "centre", g.add("Mul", radius_squared, g.constant(2 * NEIGHBOURHOOD**2)), 1)
    source_moments, target_moments = _moments(g, weights)
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

    cx, cy = _columns(g, "centre")
    rate = g.add("Div", g.constant(-0.5), radius_squared)
    weighted = g.add("Unsqueeze", g.add("Mul", table, "strength"), g.constant([2], np.int64))
    for fine in ("", "fine_"):
        across = _axis_gaussians(g, f"{fine}columns", cx, rate)
        down = _axis_gaussians(g, f"{fine}rows", cy, rate)
        _mixture(g, weighted, across, down, fine)

    def port(name: str, *shape: str | int) -> object:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)

    points = [port(name, "K", 2) for name in ("source", "target", "centre")]
    grids = [
        port("columns", "N", "C"),
        port("rows", "N", "R"),
        port("fine_columns", "M", "D"),
        port("fine_rows", "M", "S"),
    ]
    inputs = [*points, port("radius", "K", 1), port("strength", "K", 1), *grids]
    outputs = [port("flow", "N", "R", "C", 2), port("fine_flow", "M", "S", "D", 2)]
    graph = helper.make_graph(g.nodes, "first_order_motion", inputs, outputs, g.constants)
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


def _axis_gaussians(g: _Graph, places: str, centres: str, rate: str) -> str:
    """exp(rate · (place − centre)²), (N, K, places), of places (N, some) along one axis, centres and rates (K, 1)."""
    difference = g.add("Sub", g.add("Unsqueeze", places, g.constant([1], np.int64)), centres)
    exponent = g.add("Mul", g.add("Mul", difference, difference), rate)
    return g.add("Exp", g.add("Max", exponent, g.constant(LEAST_EXPONENT)))


def _moments(g: _Graph, weights: str) -> tuple[list[str], list[str]]:
    """Σ_j w_ij (p_j − p_i)(t_j − t_i)ᵀ for each i, of p the sources and p the targets: four (K, 1) each, row by row.

    One difference is taken before the sum, so that what the other's product out of the brackets loses is little.
    """
    points = [*_columns(g, "source"), *_columns(g, "target")]
    one = g.add("Add", g.add("Mul", points[0], g.constant(0.0)), g.constant(1.0))
    table = g.add("Concat", *points, one, axis=1)
    found = []
    for i, to in enumerate(points[2:]):
        weighted = g.add("Mul", weights, g.add("Sub", g.add("Transpose", to, perm=[1, 0]), to))
        sums = [f"sum{i}{j}" for j in range(5)]
        g.add("Split", g.add("MatMul", weighted, table), g.constant([1] * 5, np.int64), out=sums[0], axis=1)
        g.nodes[-1].output.extend(sums[1:])
        found.append([g.add("Sub", s, g.add("Mul", p, sums[4])) for s, p in zip(sums[:4], points, strict=True)])
    by_x, by_y = found
    return [by_x[0], by_y[0], by_x[1], by_y[1]], [by_x[2], by_y[2], by_x[3], by_y[3]]


def _mixture(g: _Graph, weighted: str, across: str, down: str, fine: str) -> None:
    """The output `{fine}flow` (N, R, C, 2) of affine maps (K, 7, 1) mixed on grids.

    A Gaussian is a product of one over columns (N, K, C) and one over rows (N, K, R), so a sum of Gaussians is one
    matrix product a grid.
    """
    middle, last = g.constant([1], np.int64), g.constant([2], np.int64)
    columns, rows = f"{fine}columns", f"{fine}rows"
    spread = g.add("Mul", g.add("Unsqueeze", across, last), weighted)  # (N, K, 7, C)
    spread = g.add("Reshape", spread, g.constant([0, 0, -1], np.int64))
    mixed = g.add("MatMul", g.add("Transpose", down, perm=[0, 2, 1]), spread)
    shape = g.add("Concat", g.constant([0, 0, 7], np.int64), g.add("Shape", columns, start=1), axis=0)
    names = [f"{fine}part{i}" for i in range(7)]
    g.add("Split", g.add("Reshape", mixed, shape), g.constant([1] * 7, np.int64), out=names[0], axis=2)
    g.nodes[-1].output.extend(names[1:])
    parts = [g.add("Squeeze", name, last) for name in names]  # (N, R, C)
    x, y = g.add("Unsqueeze", columns, middle), g.add("Unsqueeze", rows, last)
    total = g.add("Add", parts[6], g.constant(BACKGROUND))
    flows = []
    for by_x, by_y, offset in (parts[:3], parts[3:6]):
        flow = g.add("Add", g.add("Add", g.add("Mul", by_x, x), g.add("Mul", by_y, y)), offset)
        flows.append(g.add("Unsqueeze", g.add("Div", flow, total), g.constant([3], np.int64)))
    g.add("Concat", *flows, out=f"{fine}flow", axis=3)


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
