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
from identification.model.simulate import Simulator
from identification.model.split_scan import SplitScan, split_scan_of
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
    size = n + history_size(simulator.model)
    seeds = np.concatenate([directions, np.zeros((directions.shape[0], n))], axis=1)
    start = np.concatenate([np.zeros((size, m)), np.eye(size, n)], axis=1)
    carries = [carry[:, 0] for carry in simulator.carries(states, 1)]
    slopes = [start] * len(carries)
    scan = _tangent_scan(simulator.model, simulator.plan)
    lengths = [record.rows for record in simulator.records]
    tails: dict[int, list[Array]] = {}
    for going, parts in blocks(lengths, simulator.steps, lead, rows):
        first = parts[0].start
        stretches = [simulator.stretch(k, part) for k, part in zip(going, parts, strict=True)]
        found = scan(
            [inputs for inputs, _ in stretches],
            values,
            seeds,
            [carries[k] for k in going],
            [slopes[k] for k in going],
        )
        for k, (_, at), end, slope, *both in zip(going, stretches, *found, strict=True):
            carries[k], slopes[k] = end, slope
            own = both if at is None else [each[at] for each in both]
            if k in tails:
                own = [np.concatenate(pair) for pair in zip(tails[k], own, strict=True)]
            if lead:
                tails[k] = [each[-lead:].copy() for each in own]
            repeated = lead if first else 0
            yield TangentBlock(k, first - repeated, repeated, *own)


@lru_cache
def _tangent_scan(model: MotorModel, plan: StepPlan) -> SplitScan:
    x, u, p = model.symbols(history_size(model))
    dx, dp = ca.SX.sym("dx", x.numel()), ca.SX.sym("dp", p.numel())
    both, seeds = ca.vertcat(x, p), ca.vertcat(dx, dp)
    step = step_function(model, plan)
    following, logged = step(x, u, p)
    slopes, tangents = (ca.jtimes(each, both, seeds) for each in (following, logged))
    split = ca.Function("tangent", [x, dx, u, p, dp], [following, slopes, logged, tangents])
    return split_scan_of(split, step.n_instructions())
