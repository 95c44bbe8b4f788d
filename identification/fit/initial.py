"""Initial state of a record, fitted to its first samples with the parameters held.

A prediction may use nothing of a run except its inputs and its initial state.  A single noisy
sample of each sensor would start a spurious transient, so the state is fitted to a short head of
the record by Gauss-Newton.

A per-record temperature course that the log does not resolve is fitted to the whole record, like
the temperature of a run without a log.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.fit.derivatives import products
from identification.fit.own_states import state_prior
from identification.linear import solution
from identification.model.composite import MotorModel
from identification.model.simulate import Simulator, initial_states
from identification.model.tangent import tangent
from identification.model.term import AbstractTemperature
from identification.model.weighting import Weighting

__all__ = ["fitted_initial_states"]

_LEAST_HEAD: Final = 50
_HEAD: Final = (0.1,)
_WHOLE: Final = (0.1, 1.0)
_GROWING: Final = (0.1, 0.3, 1.0)
"""Fractions of a record that are fitted in turn; growing ones for an unknown phase."""
_STEPS: Final = 4
_NEGLIGIBLE: Final = 0.01
"""Gain in log likelihood below which no step is taken: a state moves by 0.14 standard deviations
at most."""
_SHARES: Final = np.array([1.0, 0.5, 0.2, 0.0])


def fitted_initial_states(
    simulator: Simulator,
    values: Array,
    deviation: Array,
    *,
    whole: bool = False,
    most: float = 1.0,
    start: tuple[Array, ...] | None = None,
) -> tuple[Array, ...]:
    """Initial state (n_state,) of every record of `simulator`, with the parameters held.

    The values are (n_parameter,) physical, the noise of current and speed is (2,) [A, rad/s].
    Whole records are fitted if `whole`, as for a phase that the head does not determine.  Except
    for a temperature, the fitted part then grows in steps, since an initial phase error prevents
    convergence over a whole record.  A close start is improved on the last part at once.  Only the
    fraction `most` of each record is fitted, so that the rest is predicted, except for an error of
    the temperature, of which no part of a record predicts another.
    """
    shares = _shares(simulator.model, whole, most)
    if start is not None:
        return _fitted_to_heads(simulator, values, deviation, shares[-1], start)
    states = tuple(initial_states(simulator.model, record) for record in simulator.records)
    for share in shares:
        states = _fitted_to_heads(simulator, values, deviation, share, states)
    return states


def _shares(model: MotorModel, whole: bool, most: float) -> tuple[float, ...]:
    """Fractions of a record that are fitted in turn."""
    own = [term for term in model.terms if any(state.is_own for state in term.states)]
    if own and all(isinstance(term, AbstractTemperature) for term in own):
        return _WHOLE
    has_temperature = any(isinstance(term, AbstractTemperature) for term in own)
    if has_temperature:
        return _GROWING
    return tuple(min(share, most) for share in _GROWING) if whole else _HEAD


def _fitted_to_heads(
    simulator: Simulator, values: Array, deviation: Array, share: float, states: tuple[Array, ...]
) -> tuple[Array, ...]:
    """Initial states fitted to the first part of every record, starting from `states`."""
    heads = tuple(
        record.segment(0, max(_LEAST_HEAD, int(share * record.rows)))
        for record in simulator.records
    )
    substeps = simulator.substeps and tuple(
        each.of(slice(0, head.rows)) for each, head in zip(simulator.substeps, heads, strict=True)
    )
    short = Simulator(simulator.model, heads, simulator.plan, substeps)
    weighting = replace(Weighting.white(heads), deviation=deviation)
    priors = [state_prior(short, k) for k in range(len(heads))]
    nothing = np.zeros((values.size, 0))
    short = short.roughly_accurate(values, states, deviation)
    for _ in range(_STEPS):
        moves, gain = [], 0.0
        for k, (record, logged, slopes) in enumerate(
            zip(heads, *tangent(short, values, states, nothing), strict=True)
        ):
            full, right = products(record.measured - logged, slopes, weighting, k)
            precision, pull = priors[k]
            right = right + pull - precision @ states[k]
            moves.append(solution(full + precision, right))
            gain = max(gain, 0.5 * float(right @ moves[k]))
        if gain < _NEGLIGIBLE:
            break
        if not simulator.model.terms:
            # The nominal model is linear: the full step reaches the optimum.
            states = tuple(state + move for state, move in zip(states, moves, strict=True))
            continue
        trials = [s[:, None] + m[:, None] * _SHARES for s, m in zip(states, moves, strict=True)]
        # A record that began at rest may start with a jump after the step.
        moved = [trial[:, 0] for trial in trials]
        short = short.roughly_accurate(values, moved, deviation, rounds=1)
        best = []
        for k, y in enumerate(short.logged(np.repeat(values[:, None], _SHARES.size, 1), trials)):
            record = heads[k]
            residual = (record.measured[:, :, None] - y) / deviation[:, None]
            with np.errstate(over="ignore", invalid="ignore"):
                cost = np.einsum("nc,ncl->l", record.weight, residual**2)
            precision, pull = priors[k]
            cost += np.sum(trials[k] * (precision @ trials[k] - 2.0 * pull[:, None]), axis=0)
            best.append(trials[k][:, int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))])
        states = tuple(best)
    return states
