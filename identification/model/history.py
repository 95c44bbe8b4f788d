"""History buffers of delayed and averaged channels.

A delayed channel is read at an instant within each sample interval: the step is taken a second
time, up to that instant, and the reading there enters the buffer of the delay.  It is as accurate
as the states, also where the current settles within a fraction of a sample interval.  The buffer
holds the reading of the interval that is being integrated, then those of past ones, the latest
first.

An averaged channel keeps its integral over the interval so far and its last average.  If it is
delayed, it also keeps its average a from the instant to the end of the last interval: with a share
f of the interval before the instant, the average over the last h seconds is the integral up to the
instant over h, plus (1 - f) a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.composite import CHANNELS, INPUTS, MotorModel
from identification.model.term import AbstractDelay, Expression

__all__ = ["Moment", "history_size", "initial_history", "shares_before", "updated_history"]

_MEAN: Final = 2
"""Values per averaged channel: integral over the interval so far, last average."""
_LEAST: Final = 1e-9
"""Share of a substep before an instant at its start: above zero, since inputs are divided by it."""


@dataclass(frozen=True)
class Moment:
    """A moment of a substep."""

    states: Expression
    """(n_state + n_averaged,) states, then the integrals of the averaged channels up to it."""
    inputs: Expression
    """(n_input,) inputs."""


def history_size(model: MotorModel) -> int:
    """Number of history values in the carry, after the state."""
    return initial_history(model, np.zeros(2)).size


def initial_history(model: MotorModel, logged: Array) -> Array:
    """History (n_history,) before the first sample, as if the channels had been constant.

    `logged` (2,) is current and speed at the first sample [A, rad/s].
    """
    parts = [np.array([0.0, logged[channel]]) for channel in model.averaged]
    for term in model.delays:
        for channel in _delayed(term):
            size = 1 + term.depth + (channel in model.averaged)
            parts.append(np.full(size, logged[channel]))
    return np.concatenate(parts) if parts else np.zeros(0)


def shares_before(model: MotorModel, inputs: Expression, parameter: Expression) -> list[Expression]:
    """For each delay, the share [-] of the substep before its instant.

    It is about 0 in the substeps after the instant, and 1 in those before.
    """
    index, count = (inputs[INPUTS.index(name)] for name in ("substep", "substeps"))
    found = []
    for term in model.delays:
        share = _share_before(model.lag(term, parameter)) * count - index
        share = ca.if_else(share < 0, 0, ca.if_else(share > 1, 1, share))
        found.append(_LEAST + (1 - _LEAST) * share)
    return found


def updated_history(
    model: MotorModel,
    history: Expression,
    moments: tuple[Moment, Expression, Sequence[Moment]],
    parameter: Expression,
) -> tuple[Expression, Expression]:
    """Update the history over one substep; return it with the readings at its start.

    The moments are the start of the substep, the states of its end, and for each delay the moment
    after the share of `shares_before`.  The history (n_history,) is given at the start and returned
    at the end; the readings are (2,).
    """
    start, end, instants = moments
    index, count, interval = (
        start.inputs[INPUTS.index(name)] for name in ("substep", "substeps", "interval")
    )
    begins, ends = index < 0.5, index > count - 1.5
    # The last interval of a record has zero length.
    inverse = ca.if_else(interval > 0, 1 / (interval * count), 0)
    n, at = len(model.state_names), 0
    now = model.logged(start.states[:n], start.inputs, parameter)
    readings, kept = [now[0], now[1]], []
    before: dict[int, Expression] = {}
    total: dict[int, Expression] = {}
    for row, channel in enumerate(model.averaged):
        before[channel] = ca.if_else(begins, 0, history[at])
        total[channel] = before[channel] + end[n + row]
        readings[channel] = history[at + 1]
        kept += [total[channel], ca.if_else(ends, total[channel] * inverse, history[at + 1])]
        at += _MEAN
    for instant, term in zip(instants, model.delays, strict=True):
        read = model.logged(instant.states[:n], instant.inputs, parameter)
        lag = model.lag(term, parameter)
        share = _share_before(lag)
        # The reading of the last substep that begins before the instant remains.
        is_before = begins + (share * count > index) > 0
        for channel in _delayed(term):
            here, past = history[at], history[at + 1 : at + 1 + term.depth]
            at += 1 + term.depth
            new = read[channel]
            if channel in model.averaged:
                integral = instant.states[n + model.averaged.index(channel)]
                new = (before[channel] + integral) * inverse + (1 - share) * history[at]
            here = ca.if_else(is_before, new, here)
            kept += [here, ca.if_else(ends, ca.vertcat(here, past[:-1]), past)]
            if channel in model.averaged:
                after = history[at] + (total[channel] * inverse - here) / (1 - share)
                kept.append(ca.if_else(ends, after, history[at]))
                at += 1
            readings[channel] = _looked_up(past, term.depth, lag, readings[channel])
    return ca.vertcat(*kept), ca.vertcat(*readings)


def _delayed(term: AbstractDelay) -> tuple[int, ...]:
    return (0, 1) if term.channel == "voltage" else (CHANNELS.index(term.channel),)


def _share_before(lag: Expression) -> Expression:
    """Share [-] of each interval before the instant at which a channel with this lag is read."""
    return ca.ceil(lag) - lag


def _looked_up(past: Expression, depth: int, lag: Expression, now: Expression) -> Expression:
    """Reading `lag` intervals back in time; `now` if `lag` is not positive."""
    found = ca.SX(0)
    for k in range(depth):
        found += ca.if_else((lag > k) * (lag <= k + 1), past[k], 0)
    return ca.if_else(lag > 0, found, now)
