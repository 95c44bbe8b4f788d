"""What a delayed channel remembers: the last few sample intervals as cubics.

Of every interval value and slope at both ends are kept, so that a delay by any fraction of an
interval is exact to the fourth order although the slope jumps where the voltage does.  Where an
interval is computed in parts, what it began with waits until its last part ends.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from identification.model.composite import INPUTS, MotorModel
from identification.model.term import AbstractDelay, Expression

__all__ = ["memory_size", "memory_start", "remembered"]

_CHANNELS = ("current", "speed")


def memory_size(model: MotorModel) -> int:
    """Numbers in the carry behind the state."""
    return sum((2 + 4 * int(term.depth)) * len(_delayed(term)) for term in model.delays)


def memory_start(model: MotorModel, logged: NDArray[np.float64]) -> NDArray[np.float64]:
    """Memory before the first sample, as if the channels had stood still.

    Args:
        model: The model.
        logged: (2,) current and speed at the first sample [A, rad/s].

    Returns:
        (n_memory,)
    """
    parts = [
        np.concatenate(
            [
                [logged[channel], 0.0],
                np.tile([logged[channel], logged[channel], 0.0, 0.0], int(term.depth)),
            ]
        )
        for term in model.delays
        for channel in _delayed(term)
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def remembered(
    model: MotorModel,
    states: tuple[Expression, Expression],
    memory: Expression,
    inputs: tuple[Expression, Expression],
    parameter: Expression,
    logged: Expression,
) -> tuple[Expression, Expression]:
    """Memory after this interval, and the delayed log at its beginning.

    Args:
        model: The model.
        states: (n_state,) at the beginning and at the end of the interval.
        memory: (n_memory,) of the intervals before.
        inputs: Inputs at the beginning and at the end of the interval.
        parameter: (n_parameter,).
        logged: (2,) what would be logged without delay.

    Returns:
        (n_memory,) and (2,).
    """
    part, count = (inputs[0][INPUTS.index(name)] for name in ("part", "parts"))
    begins, ends = part < 0.5, part > count - 1.5
    interval = inputs[0][0] * count
    values, slopes = [], []
    for x, u in zip(states, inputs, strict=True):
        value, slope = _value_and_slope(model, x, u, parameter)
        values.append(value)
        slopes.append(slope * interval)
    kept, delayed = [], [logged[0], logged[1]]
    start = 0
    for term in model.delays:
        lag = model.lag(term, parameter)
        depth = int(term.depth)
        for channel in _delayed(term):
            waiting = memory[start : start + 2]
            past = memory[start + 2 : start + 2 + 4 * depth]
            start += 2 + 4 * depth
            began = [
                ca.if_else(begins, now, before)
                for now, before in (
                    (values[0][channel], waiting[0]),
                    (slopes[0][channel], waiting[1]),
                )
            ]
            whole = ca.vertcat(began[0], values[1][channel], began[1], slopes[1][channel])
            moved = ca.vertcat(whole, past[: 4 * (depth - 1)])
            kept += [*began, ca.if_else(ends, moved, past)]
            delayed[channel] = _looked_up(past, depth, lag, delayed[channel])
    return ca.vertcat(*kept), ca.vertcat(*delayed)


def _delayed(term: AbstractDelay) -> tuple[int, ...]:
    return (0, 1) if term.channel == "voltage" else (_CHANNELS.index(term.channel),)


def _value_and_slope(
    model: MotorModel, state: Expression, inputs: Expression, parameter: Expression
) -> tuple[Expression, Expression]:
    x, u, p = (ca.SX.sym(n, s.numel()) for n, s in (("x", state), ("u", inputs), ("p", parameter)))
    logged = model.logged(x, u, p)
    function = ca.Function("slope", [x, u, p], [logged, ca.jtimes(logged, x, model.rates(x, u, p))])
    value, slope = function(state, inputs, parameter)
    return value, slope


def _looked_up(past: Expression, depth: int, lag: Expression, now: Expression) -> Expression:
    """Value `lag` intervals before the beginning of this one; `now` where lag is not positive."""
    found = now * (lag <= 0)
    for k in range(depth):
        y0, y1, s0, s1 = (past[4 * k + j] for j in range(4))
        at = 1 - (lag - k)
        cubic = (
            y0 * (1 + 2 * at) * (1 - at) ** 2
            + s0 * at * (1 - at) ** 2
            + y1 * at**2 * (3 - 2 * at)
            - s1 * at**2 * (1 - at)
        )
        here = (lag > k) * (lag <= k + 1)
        found = found + ca.if_else(here, cubic, 0)
    return found
