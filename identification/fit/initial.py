"""The state in which a run begins, from its first samples.

A prediction may use nothing of a run but its inputs; only the state at the first sample has to
come from somewhere, and a single noisy sample of each sensor would start a transient that is not
there.  So the state is fitted to a short head of the run with the parameters held.

The course of a temperature that the log does not tell is fitted to the whole run, as the
temperature of a run without a log is.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from identification.fit.normal_equations import products, state_precision
from identification.linear import solution
from identification.model.composite import MotorModel
from identification.model.excitation import Record
from identification.model.simulate import Simulator, initial_states
from identification.model.tangent import tangent_blocks
from identification.model.term import AbstractTemperature
from identification.model.weighting import Weighting

__all__ = ["fitted_initial_states"]

Array = NDArray[np.float64]

_LEAST_HEAD: Final = 50
_GROWING: Final = (0.1, 0.3, 1.0)
"""Shares of a record that are looked at, one after the other where all of it may be."""
_STEPS: Final = 4
_ROUGH: Final = 0.1
"""Share of the noise by which one interval of a head may be wrong."""
_SHARES: Final = np.array([1.0, 0.5, 0.2, 0.0])


def fitted_initial_states(
    simulator: Simulator, values: Array, deviation: Array, *, whole: bool = False
) -> tuple[Array, ...]:
    """Initial state of every record of `simulator`.

    Args:
        simulator: Model and records.
        values: (n_parameter,) physical.
        deviation: (2,) noise of current and speed [A, rad/s].
        whole: Whether to look at whole records, where a phase is asked for that no head shows.
            What turns further and further is lost at once where it begins with another phase, so
            that the heads grow until they are whole.

    Returns:
        For each record (n_state,).
    """
    states = tuple(initial_states(simulator.model, record) for record in simulator.records)
    whole = whole or _has_own_temperature(simulator.model)
    for share in _GROWING if whole else _GROWING[:1]:
        states = _fitted_to_heads(simulator, values, deviation, share, states)
    return states


def _has_own_temperature(model: MotorModel) -> bool:
    """Whether records have a temperature of their own beside the log's."""
    bodies = [term for term in model.terms if isinstance(term, AbstractTemperature)]
    return any(state.is_own for term in bodies for state in term.states)


def _fitted_to_heads(
    simulator: Simulator, values: Array, deviation: Array, share: float, states: tuple[Array, ...]
) -> tuple[Array, ...]:
    """States fitted to the first part of every record, from `states`."""
    heads = tuple(_head(record, share) for record in simulator.records)
    short = Simulator(simulator.model, heads, simulator.plan)
    weighting = replace(Weighting.white(heads), deviation=deviation)
    centres = [initial_states(simulator.model, record) for record in heads]
    nothing = np.zeros((values.size, 0))
    if simulator.model.terms:
        short = short.divided_for(values, states, _ROUGH * deviation)
    for _ in range(_STEPS):
        moves = []
        blocks = tangent_blocks(short, values, states, nothing, rows=None)
        for k, (record, block) in enumerate(zip(heads, blocks, strict=True)):
            full, right = products(record.measured - block.logged, block.tangent, weighting, k)
            precision = state_precision(short, k)
            right = right + precision * (centres[k] - states[k])
            moves.append(solution(full + np.diag(precision), right))
        if not simulator.model.terms:
            # The motor is linear: the step leads to the optimum.
            states = tuple(state + move for state, move in zip(states, moves, strict=True))
            continue
        trials = [s[:, None] + m[:, None] * _SHARES for s, m in zip(states, moves, strict=True)]
        # What began at rest may begin with a jump after the move.
        moved = [trial[:, 0] for trial in trials]
        short = short.divided_for(values, moved, _ROUGH * deviation, start=short.divisions)
        best = []
        for k, y in enumerate(short.logged(np.repeat(values[:, None], _SHARES.size, 1), trials)):
            record = heads[k]
            residual = (record.measured[:, :, None] - y) / deviation[:, None]
            with np.errstate(over="ignore", invalid="ignore"):
                cost = np.einsum("nc,ncl->l", record.weight, residual**2)
            cost += state_precision(short, k) @ (trials[k] - centres[k][:, None]) ** 2
            best.append(trials[k][:, int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))])
        states = tuple(best)
    return states


def _head(record: Record, share: float) -> Record:
    rows = min(record.rows, max(_LEAST_HEAD, int(share * record.rows)))
    inputs = record.inputs[:rows].copy()
    inputs[-1, 0] = 0.0
    return replace(
        record,
        time=record.time[:rows],
        inputs=inputs,
        measured=record.measured[:rows],
        weight=record.weight[:rows],
        whole=None,
    )
