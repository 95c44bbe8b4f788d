"""History buffers of delayed, averaged and filtered channels.

A delayed channel is read at an instant within each sample interval: the step is taken a second
time, up to that instant, and the reading there enters the buffer of the delay.  It is as accurate
as the states, also where the current settles within a fraction of a sample interval.  The buffer
holds the reading of the interval that is being integrated, then those of past ones, the latest
first.

An averaged channel keeps its integral over the interval so far, and its means over past intervals,
the latest first; their weighted sum is the average over a window of n intervals.  The window may
end within an interval, in which the signal is taken for the line through two means.

A channel with both keeps its means between the instants instead: the integral up to the instant
over the interval h, plus (1 - f) a, with the share f of the interval before the instant and the
mean a from the instant to the end of the interval before.

A digital filter keeps past samples or readings.  It is applied last: a filter of the samples
commutes with delays and averages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import casadi as ca
import numpy as np

from identification.arrays import Array
from identification.model.composite import CHANNELS, INPUTS, MotorModel
from identification.model.term import AbstractDelay, AbstractMean, Expression

__all__ = [
    "Moment",
    "history_size",
    "initial_history",
    "shares_before",
    "updated_history",
    "windowed",
]

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
    parts: list[Array] = []
    for channel, term in model.averaged.items():
        parts += [np.zeros(1), np.full(term.intervals, logged[channel])]
    for delay in model.delays:
        for channel in _delayed(delay):
            mean = model.averaged.get(channel)
            size = 1 + _depth(delay.depth, mean) + bool(mean)
            parts.append(np.full(size, logged[channel]))
    for digital in model.sample_filters:
        parts.append(np.full(digital.memory, logged[CHANNELS.index(digital.channel)]))
    return np.concatenate(parts) if parts else np.zeros(0)


def shares_before(model: MotorModel, inputs: Expression, parameter: Expression) -> list[Expression]:
    """For each delay, the share [-] of the substep before its instant.

    It is about 0 in the substeps after the instant, and 1 in those before.
    """
    index, count = (inputs[INPUTS.index(name)] for name in ("substep", "substeps"))
    found = []
    for term in model.delays:
        share = _share_before(term.lag(model.own_values(term, parameter))) * count - index
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
    buffer, substep = _Buffer(ca.vertsplit(history)), _Substep.of(start.inputs)
    n = len(model.state_names)
    now = model.logged(start.states[:n], start.inputs, parameter)
    readings = [now[0], now[1]]
    means: dict[int, _Mean] = {}
    for row, (channel, term) in enumerate(model.averaged.items(), start=n):
        window = term.window(model.own_values(term, parameter))
        mean = means[channel] = _Mean(row, term.intervals, window)
        readings[channel] = mean.updated(buffer, substep, end[row])
    for instant, delay in zip(instants, model.delays, strict=True):
        lag = _Lag(delay.lag(model.own_values(delay, parameter)), delay.depth)
        read = model.logged(instant.states[:n], instant.inputs, parameter)
        for channel in _delayed(delay):
            own = means.get(channel)
            late = lag.updated(buffer, substep, read[channel], instant.states, own)
            readings[channel] = ca.if_else(lag.value > 0, late, readings[channel])
    for digital in model.sample_filters:
        channel, past = CHANNELS.index(digital.channel), buffer.take(digital.memory)
        values = model.own_values(digital, parameter)
        readings[channel], following = digital.filtered(readings[channel], past, values)
        pairs = zip(following, past, strict=True)
        buffer.keep(*(ca.if_else(substep.begins, new, old) for new, old in pairs))
    return ca.vertcat(*buffer.kept), ca.vertcat(*readings)


class _Buffer:
    """History, taken value by value and kept in the same order."""

    def __init__(self, values: Sequence[Expression]) -> None:
        self._left = iter(values)
        self.kept: list[Expression] = []

    def take(self, number: int) -> list[Expression]:
        return [next(self._left) for _ in range(number)]

    def keep(self, *values: Expression) -> None:
        self.kept += values

    def shift(self, past: Sequence[Expression], latest: Expression, ends: Expression) -> None:
        """Keep the latest value before the past ones, at the end of an interval."""
        moved = (latest, *past[:-1])
        self.kept += [ca.if_else(ends, new, old) for new, old in zip(moved, past, strict=True)]


@dataclass(frozen=True)
class _Substep:
    """Place of a substep in its sample interval."""

    index: Expression
    """Substeps of this length before it [-]."""
    count: Expression
    """Substeps of this length in the interval [-]."""
    inverse: Expression
    """Reciprocal of the interval [1/s]; zero for the last one of a record, which has no length."""

    @staticmethod
    def of(inputs: Expression) -> _Substep:
        names = ("substep", "substeps", "interval")
        index, count, length = (inputs[INPUTS.index(name)] for name in names)
        return _Substep(index, count, ca.if_else(length > 0, 1 / (length * count), 0))

    @property
    def begins(self) -> Expression:
        """True in the first substep of an interval."""
        return self.index < 0.5

    @property
    def ends(self) -> Expression:
        """True in the last substep of an interval."""
        return self.index > self.count - 1.5


class _Mean:
    """Average of a channel, whose integral is a state."""

    def __init__(self, row: int, intervals: int, window: Expression) -> None:
        self.row, self.intervals, self._window = row, intervals, window
        self.before: Expression = 0
        """Integral over the part of the interval before the substep."""
        self.whole: Expression = 0
        """The same up to the end of the substep, over the interval."""

    def updated(self, buffer: _Buffer, substep: _Substep, integral: Expression) -> Expression:
        """Average at the start of a substep over which the channel has this integral."""
        (so_far,), past = buffer.take(1), buffer.take(self.intervals)
        self.before = ca.if_else(substep.begins, 0, so_far)
        total = self.before + integral
        self.whole = total * substep.inverse
        buffer.keep(total)
        buffer.shift(past, self.whole, substep.ends)
        return self.over_window(past)

    def over_window(self, means: Sequence[Expression]) -> Expression:
        """Average over the window, from the means over each interval, the latest first."""
        return windowed(means, self._window)


@dataclass(frozen=True)
class _Lag:
    """Delay of a channel."""

    value: Expression
    """Sample intervals [-]."""
    depth: int
    """Most sample intervals."""

    def updated(
        self,
        buffer: _Buffer,
        substep: _Substep,
        read: Expression,
        states: Expression,
        mean: _Mean | None,
    ) -> Expression:
        """Delayed reading at the start of a substep, given that at the instant and its states."""
        (here,), past = buffer.take(1), buffer.take(_depth(self.depth, mean))
        share = _share_before(self.value)
        after: Expression = buffer.take(1)[0] if mean else 0
        if mean:
            read = (mean.before + states[mean.row]) * substep.inverse + (1 - share) * after
        # The reading of the last substep that begins before the instant remains.
        is_before = substep.begins + (share * substep.count > substep.index) > 0
        here = ca.if_else(is_before, read, here)
        buffer.keep(here)
        buffer.shift(past, here, substep.ends)
        if not mean:
            return self._looked_up(past)
        rest = after + (mean.whole - here) / (1 - share)
        buffer.keep(ca.if_else(substep.ends, rest, after))
        return mean.over_window([self._looked_up(past[k:]) for k in range(mean.intervals)])

    def _looked_up(self, past: Sequence[Expression]) -> Expression:
        """Value of a buffer that far back in time, if the delay is positive."""
        at = [(self.value > k) * (self.value <= k + 1) for k in range(self.depth)]
        return sum(ca.if_else(here, past[k], 0) for k, here in enumerate(at))


def windowed(values: Sequence[Expression], window: Expression) -> Expression:
    """Average of the latest values, the first ones, over a window of 1 to all of them.

    If the window ends within a value, the signal is a line through it and the one after.
    """
    count = len(values)
    if count == 1:
        return values[0]
    shares = [ca.fmin(ca.fmax(window - k, 0), 1) for k in range(count)]
    # Part of the oldest value: its end is nearer to the one after.
    nearer = [*(share * (1 - share) / 2 for share in shares), 0]
    weights = [shares[k] - nearer[k] + nearer[k + 1] for k in range(count)]
    return sum(w * value for w, value in zip(weights, values, strict=True)) / window


def _delayed(term: AbstractDelay) -> tuple[int, ...]:
    return (0, 1) if term.channel == "voltage" else (CHANNELS.index(term.channel),)


def _depth(depth: int, mean: _Mean | AbstractMean | None) -> int:
    """Past readings of a channel with a delay up to `depth`, with those that its average needs."""
    return depth + (mean.intervals - 1 if mean else 0)


def _share_before(lag: Expression) -> Expression:
    """Share [-] of each interval before the instant at which a channel with this lag is read."""
    return ca.ceil(lag) - lag
