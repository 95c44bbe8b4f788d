"""Derivatives of what a simulator logs, by parameters and initial states.

    blocks = tangent_blocks(simulator, values, states, directions)

They come from CasADi's derivative of the very step that is simulated, so they are those of the
discrete model, exact to rounding.  A derivative is a number for each sample, channel and direction,
most of what a fit would hold in memory; so long records are gone through in blocks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.model.composite import INPUTS, MotorModel
from identification.model.memory import memory_size
from identification.model.scan import Scan, scan_of
from identification.model.simulate import Simulator
from identification.model.step import Plan, step_function

__all__ = ["BLOCK", "TangentBlock", "stretch", "tangent", "tangent_blocks"]

Array = NDArray[np.float64]

_STRUCTURES: Final = 128
BLOCK: Final = 65_536
"""Samples whose derivatives are in memory together; tens of megabytes."""


@dataclass(frozen=True)
class TangentBlock:
    """What some samples of a record log, and its derivatives.

    Args:
        record: Number of the record.
        start: Its first sample here.
        lead: Samples at the head that the block before held as well.
        logged: (n_sample, 2) [A, rad/s].
        tangent: (n_sample, 2, n_direction + n_state) its derivatives by the directions and, after
            them, by the initial states.
    """

    record: int
    start: int
    lead: int
    logged: Array
    tangent: Array

    @property
    def samples(self) -> slice:
        """The samples of the record, those of the lead as well."""
        return slice(self.start, self.start + self.logged.shape[0])


def tangent(
    simulator: Simulator, values: Array, states: Sequence[Array], directions: Array
) -> tuple[list[Array], list[Array]]:
    """`tangent_blocks` of whole records.

    Args:
        simulator: Model and records.
        values: (n_parameter,) physical.
        states: For each record (n_state,).
        directions: (n_parameter, n_direction) physical.

    Returns:
        For each record the logged channels (n_sample, 2) and their derivatives
        (n_sample, 2, n_direction + n_state).
    """
    blocks = list(tangent_blocks(simulator, values, states, directions, rows=None))
    return [block.logged for block in blocks], [block.tangent for block in blocks]


def tangent_blocks(
    simulator: Simulator,
    values: Array,
    states: Sequence[Array],
    directions: Array,
    lead: int = 0,
    rows: int | None = BLOCK,
) -> Iterator[TangentBlock]:
    """Logged channels and their derivatives, by parameters and by initial states.

    Memory grows with a block and not with the records.

    Args:
        simulator: Model and records.
        values: (n_parameter,) physical.
        states: For each record (n_state,).
        directions: (n_parameter, n_direction) physical.
        lead: Samples of the block before that are repeated at the head of each.
        rows: Samples of the blocks of all records at one time; None for whole records.
    """
    n, m = simulator.n_state, directions.shape[1]
    lanes = m + n
    size = n + memory_size(simulator.model)
    seeds = np.concatenate([directions, np.zeros((directions.shape[0], n))], axis=1)
    parameter = np.concatenate([np.repeat(values[:, None], lanes, axis=1), seeds])
    start = np.concatenate([np.zeros((size, m)), np.eye(size, n)], axis=1)
    carries = [np.concatenate([carry, start]) for carry in simulator.carries(states, lanes)]
    scan = _tangent_scan(simulator.model, simulator.plan)
    lengths = [record.rows for record in simulator.records]
    most = max(lengths) if rows is None else max(rows // len(lengths), lead, 1)
    tails: dict[int, Array] = {}
    for first in range(0, max(lengths), most):
        going = [k for k, length in enumerate(lengths) if length > first]
        stretches = [stretch(simulator, k, first, first + most) for k in going]
        ends, outputs = scan(
            [inputs for inputs, _ in stretches], parameter, [carries[k] for k in going]
        )
        for k, end, output, (_, at) in zip(going, ends, outputs, stretches, strict=True):
            carries[k] = end
            own = output if at is None else output[at]
            if k in tails:
                own = np.concatenate([tails[k], own])
            if lead:
                tails[k] = own[-lead:].copy()
            repeated = lead if first else 0
            yield TangentBlock(k, first - repeated, repeated, own[:, :2, 0], own[:, 2:, :])


def stretch(
    simulator: Simulator, k: int, start: int, stop: int
) -> tuple[Array, NDArray[np.intp] | None]:
    """Inputs of some samples of a record, and the rows of them at which samples lie.

    Args:
        simulator: Model and records.
        k: Number of the record.
        start: First sample.
        stop: The sample after the last; beyond the end for all that are left.

    Returns:
        (n_row, n_input), and (n_sample,) rows, None where every row is a sample.
    """
    inputs = simulator.inputs[k]
    if simulator.begins is None:
        return inputs[start:stop], None
    begins = simulator.begins[k]
    first = begins[start]
    end = begins[stop] if stop < begins.size else inputs.shape[0]
    return inputs[first:end], begins[start:stop] - first


@lru_cache(_STRUCTURES)
def _tangent_scan(model: MotorModel, plan: Plan) -> Scan:
    u, p = ca.SX.sym("u", len(INPUTS)), ca.SX.sym("p", len(model.parameters))
    x = ca.SX.sym("x", len(model.state_names) + memory_size(model))
    dx, dp = ca.SX.sym("dx", x.numel()), ca.SX.sym("dp", p.numel())
    both, seeds = ca.vertcat(x, p), ca.vertcat(dx, dp)
    following, logged = step_function(model, plan)(x, u, p)
    step = ca.Function(
        "tangent",
        [ca.vertcat(x, dx), u, ca.vertcat(p, dp)],
        [
            ca.vertcat(following, ca.jtimes(following, both, seeds)),
            ca.vertcat(logged, ca.jtimes(logged, both, seeds)),
        ],
    )
    return scan_of(step, effort="some")
