"""Derivatives of the simulated readings with respect to parameters and initial states.

    blocks = tangent_blocks(simulator, values, states, directions)

CasADi differentiates the simulated step itself, so the derivatives are those of the discrete model,
exact to rounding.  They hold one number per sample, channel and direction, which dominates the
memory of a fit; long records are therefore processed in blocks.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.blocks import BLOCK, blocks
from identification.model.composite import MotorModel
from identification.model.history import history_size
from identification.model.scan import Scan, scan_of
from identification.model.simulate import Simulator
from identification.model.step import step_function
from identification.model.step_plan import StepPlan

__all__ = ["TangentBlock", "tangent", "tangent_blocks"]


@dataclass(frozen=True)
class TangentBlock:
    """Simulated readings of a block of samples of one record, and their derivatives."""

    record: int
    start: int
    """Index of the block's first sample in the record."""
    lead: int
    """Number of samples at the start that repeat the end of the previous block."""
    logged: Array
    """(n_sample, 2) [A, rad/s]."""
    tangent: Array
    """(n_sample, 2, n_direction + n_state) derivatives along the directions, then with respect to
    the initial states."""

    @property
    def samples(self) -> slice:
        """Samples of the record in this block, including the repeated ones."""
        return slice(self.start, self.start + self.logged.shape[0])


def tangent(
    simulator: Simulator, values: Array, states: Sequence[Array], directions: Array
) -> tuple[list[Array], list[Array]]:
    """Readings (n_sample, 2) and derivatives of whole records, computed in blocks.

    The derivatives of a record are (n_sample, 2, n_direction + n_state); the arguments are those of
    `tangent_blocks`.
    """
    size = directions.shape[1] + simulator.n_state
    logged = [np.empty((record.rows, 2)) for record in simulator.records]
    slopes = [np.empty((record.rows, 2, size)) for record in simulator.records]
    for block in tangent_blocks(simulator, values, states, directions):
        logged[block.record][block.samples] = block.logged
        slopes[block.record][block.samples] = block.tangent
    return logged, slopes


def tangent_blocks(
    simulator: Simulator,
    values: Array,
    states: Sequence[Array],
    directions: Array,
    lead: int = 0,
    rows: int = BLOCK,
) -> Iterator[TangentBlock]:
    """Iterate over readings and their derivatives in blocks of samples.

    The memory depends neither on the length of the records nor on their substeps: at most `rows`
    rows over all records.  Each block repeats `lead` samples of the previous one.  The values are
    (n_parameter,) physical, the directions (n_parameter, n_direction) physical, the states
    (n_state,) for each record.
    """
    n, m = simulator.n_state, directions.shape[1]
    lanes = m + n
    size = n + history_size(simulator.model)
    seeds = np.concatenate([directions, np.zeros((directions.shape[0], n))], axis=1)
    parameter = np.concatenate([np.repeat(values[:, None], lanes, axis=1), seeds])
    start = np.concatenate([np.zeros((size, m)), np.eye(size, n)], axis=1)
    carries = [np.concatenate([carry, start]) for carry in simulator.carries(states, lanes)]
    scan = _tangent_scan(simulator.model, simulator.plan)
    lengths = [record.rows for record in simulator.records]
    tails: dict[int, Array] = {}
    for going, parts in blocks(lengths, simulator.steps, lead, rows):
        first = parts[0].start
        stretches = [simulator.stretch(k, part) for k, part in zip(going, parts, strict=True)]
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


@lru_cache
def _tangent_scan(model: MotorModel, plan: StepPlan) -> Scan:
    x, u, p = model.symbols(history_size(model))
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
