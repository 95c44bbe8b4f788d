"""History buffers of delayed and averaged channels.

A delayed channel keeps value and slope at both ends of each past sample interval.  Cubic Hermite
interpolation then gives a delay by any fraction of an interval with an error of fourth order, even
if the slope jumps with the voltage at a sample.  If an interval has several substeps, value and
slope at its start are kept until its last substep ends.

An averaged channel keeps its integral over the substeps so far, and the average over the previous
interval with its slope: the average over the last h seconds has the slope (y(t) - y(t - h)) / h.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.composite import CHANNELS, INPUTS, MotorModel
from identification.model.term import AbstractDelay, Expression

__all__ = ["history_size", "initial_history", "updated_history"]

_MEAN: int = 4
"""Values per averaged channel: value at the start of the interval, integral since then, last
average and its slope."""


def history_size(model: MotorModel) -> int:
    """Number of history values in the carry, after the state."""
    delays = sum((2 + 4 * term.depth) * len(_delayed(term)) for term in model.delays)
    return _MEAN * len(model.averaged) + delays


def initial_history(model: MotorModel, logged: Array) -> Array:
    """History (n_history,) before the first sample, as if the channels had been constant.

    `logged` (2,) is current and speed at the first sample [A, rad/s].
    """
    parts = [np.array([logged[channel], 0.0, logged[channel], 0.0]) for channel in model.averaged]
    parts += [
        np.concatenate(
            [
                [logged[channel], 0.0],
                np.tile([logged[channel], logged[channel], 0.0, 0.0], term.depth),
            ]
        )
        for term in model.delays
        for channel in _delayed(term)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def updated_history(
    model: MotorModel,
    states: tuple[Expression, Expression],
    history: Expression,
    inputs: tuple[Expression, Expression],
    parameter: Expression,
    logged: Expression,
) -> tuple[Expression, Expression]:
    """Update the history over one substep; return it with the delayed and averaged readings.

    The states are (n_state,) at the start and (n_state + n_averaged,) at the end of the substep;
    the latter end with the integrals of the averaged channels over the substep.  The inputs are
    those at both.  History (n_history,) and readings (2,), without averaging and delay, are given
    at the start; the history is returned at the end.
    """
    index, count = (inputs[0][INPUTS.index(name)] for name in ("substep", "substeps"))
    begins, ends = index < 0.5, index > count - 1.5
    interval = inputs[0][0] * count
    # The last interval of a record has zero length.
    inverse = ca.if_else(interval > 0, 1 / interval, 0)
    values, slopes = [], []
    n = states[0].numel()
    for x, u in zip((states[0], states[1][:n]), inputs, strict=True):
        value, slope = _value_and_slope(model, x, u, parameter)
        values.append([value[0], value[1]])
        slopes.append([slope[0] * interval, slope[1] * interval])
    kept, delayed = [], [logged[0], logged[1]]
    start = 0
    for channel, integral in zip(model.averaged, ca.vertsplit(states[1][n:]), strict=True):
        began, total, mean, slope = (history[start + k] for k in range(_MEAN))
        start += _MEAN
        began = ca.if_else(begins, values[0][channel], began)
        total = ca.if_else(begins, 0, total) + integral
        moved = total * inverse, (values[1][channel] - began) * inverse
        after = [ca.if_else(ends, new, old) for new, old in zip(moved, (mean, slope), strict=True)]
        kept += [began, total, *after]
        delayed[channel] = mean
        values[0][channel], values[1][channel] = mean, after[0]
        slopes[0][channel], slopes[1][channel] = slope * interval, after[1] * interval
    for term in model.delays:
        lag, size = model.lag(term, parameter), 4 * term.depth
        for channel in _delayed(term):
            # Value and slope at the start of the interval, then of past ones, the latest first.
            past = history[start + 2 : start + 2 + size]
            value = ca.if_else(begins, values[0][channel], history[start])
            slope = ca.if_else(begins, slopes[0][channel], history[start + 1])
            start += 2 + size
            whole = ca.vertcat(value, values[1][channel], slope, slopes[1][channel])
            kept += [value, slope, ca.if_else(ends, ca.vertcat(whole, past[: size - 4]), past)]
            delayed[channel] = _looked_up(past, term.depth, lag, delayed[channel])
    return ca.vertcat(*kept), ca.vertcat(*delayed)


def _delayed(term: AbstractDelay) -> tuple[int, ...]:
    return (0, 1) if term.channel == "voltage" else (CHANNELS.index(term.channel),)


def _value_and_slope(
    model: MotorModel, state: Expression, inputs: Expression, parameter: Expression
) -> tuple[Expression, Expression]:
    x, u, p = (ca.SX.sym(n, s.numel()) for n, s in (("x", state), ("u", inputs), ("p", parameter)))
    logged = model.logged(x, u, p)
    function = ca.Function("slope", [x, u, p], [logged, ca.jtimes(logged, x, model.rates(x, u, p))])
    value, slope = function(state, inputs, parameter)
    return value, slope


def _looked_up(past: Expression, depth: int, lag: Expression, now: Expression) -> Expression:
    """Hermite interpolation `lag` intervals back in time; `now` if `lag` is not positive."""
    found = [ca.SX(0)] * 5
    for k in range(depth):
        here = (lag > k) * (lag <= k + 1)
        end = [past[4 * k + j] for j in range(4)]
        found = [old + ca.if_else(here, new, 0) for old, new in zip(found, [*end, k], strict=True)]
    y0, y1, s0, s1, whole = found
    at = 1 - (lag - whole)
    cubic = (
        y0 * (1 + 2 * at) * (1 - at) ** 2
        + s0 * at * (1 - at) ** 2
        + y1 * at**2 * (3 - 2 * at)
        - s1 * at**2 * (1 - at)
    )
    return ca.if_else(lag > 0, cubic, now)
