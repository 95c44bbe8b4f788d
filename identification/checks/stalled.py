"""Detection of a shaft that is held for a part of a run: an end stop, a jammed gear, a brake.

While the shaft turns, over windows of 16 intervals,

    dw/dt = g i - d w - c sign(w) + m

At standstill, friction takes at most about twice the torque that it takes of a turning shaft, so a
free shaft would turn by at least the integral of g abs(i) - 2 c.  If that passes the highest speed
of the run while the log has none, the shaft is held.  The model has nothing that holds it, so the
fit omits these samples.

The voltage balance v = R i holds there, as it does not if the speed sensor fails.

Source of the bound: Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30 (1994), 1083-1138
(break-away against Coulomb friction).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.arrays import Array, stretches
from identification.checks.balance import Signals, signals_of
from identification.checks.coasting import all_marked
from identification.checks.finding import Omission, omission
from identification.ingest.run import Run
from identification.linear import solution

__all__ = ["stalled_of"]

_REST: Final = 0.02
"""Largest speed at standstill, over the highest of the run."""
_FEWEST: Final = 20
"""Fewest samples of a standstill."""
_LENGTH: Final = 16
"""Intervals of a window."""
_TURNING: Final = 100
"""Fewest windows of a turning shaft."""
_BREAKAWAY: Final = 2.0
"""Largest friction at standstill over that of the turning shaft."""
_REACHED: Final = 1.0
"""Least speed that a free shaft would have reached, over the highest of the run."""
_CHANGED: Final = 0.5
"""Largest error of the voltage balance at a held shaft, over the voltage."""


def stalled_of(run: Run) -> Omission | None:
    """Samples of a run at which the shaft is held; None if there are none."""
    signals = signals_of(run, samples=run.rows)
    top = float(np.abs(signals.speed).max())
    stays = [
        (start, stop)
        for start, stop in stretches(np.abs(signals.speed) <= _REST * top).tolist()
        if stop - start >= _FEWEST
    ]
    found = _torque_balance(signals, _REST * top) if stays and top > 0.0 else None
    if found is None:
        return None
    gain, friction = found
    free = np.maximum(gain * np.abs(signals.current) - _BREAKAWAY * friction, 0.0)
    free = free[:-1] * np.diff(signals.time) * signals.joined
    held = np.zeros(run.rows, dtype=bool)
    largest = 0.0
    for start, stop in stays:
        reached = float(np.sum(free[start : stop - 1])) / top
        if reached > _REACHED and _is_balanced(signals, start, stop):
            held[max(start - 1, 0) : stop] = True
            largest = max(largest, reached)
    if not largest:
        return None
    statistic = "speed that a free shaft would reach relative to the highest of the run"
    return omission(
        run,
        held,
        "stalled_shaft",
        "speed_rad_s",
        "is zero while the current would turn a free shaft: an end stop, the gear or a brake holds "
        "it",
        (statistic, largest, _REACHED),
        remedy="leave stalls out of the log, or record them as a file of their own",
    )


def _torque_balance(signals: Signals, rest: float) -> tuple[float, float] | None:
    """Acceleration per current and that of dry friction; None if the current does not turn it."""
    turning = np.abs(signals.speed) > rest
    used = all_marked(turning[1:] & turning[:-1] & signals.joined, _LENGTH)
    if np.count_nonzero(used) < _TURNING:
        return None
    time, speed = signals.time, signals.speed
    rate = (speed[_LENGTH:] - speed[:-_LENGTH]) / (time[_LENGTH:] - time[:-_LENGTH])
    columns = (_means(signals.current), _means(speed), _means(np.sign(speed)), np.ones(rate.size))
    matrix = np.column_stack(columns)[used]
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    matrix /= np.where(scale > 0.0, scale, 1.0)
    moments = matrix.T @ matrix + 1e-9 * np.count_nonzero(used) * np.eye(scale.size)
    values = solution(moments, matrix.T @ rate[used]) / np.where(scale > 0.0, scale, 1.0)
    # In one direction the sign is the constant, and the ridge gives a half of it to each.
    friction = abs(float(values[2])) + abs(float(values[3]))
    return (float(values[0]), friction) if values[0] > 0.0 else None


def _is_balanced(signals: Signals, start: int, stop: int) -> bool:
    """True if voltage and current agree with a standstill as elsewhere with the speed."""
    matrix = np.column_stack([signals.current, signals.speed])
    inside = np.zeros(signals.time.size, dtype=bool)
    inside[start:stop] = True
    values = np.linalg.lstsq(matrix[~inside], signals.voltage[~inside], rcond=1e-10)[0]
    left = (signals.voltage - matrix @ values)[inside]
    size = float(np.mean(signals.voltage[inside] ** 2))
    return float(np.mean(left**2)) < _CHANGED**2 * size


def _means(signal: Array) -> Array:
    """(n_sample - length,) trapezoidal means over windows."""
    sums = np.cumsum(np.concatenate(([0.0], 0.5 * (signal[1:] + signal[:-1]))))
    return np.asarray((sums[_LENGTH:] - sums[:-_LENGTH]) / _LENGTH)
