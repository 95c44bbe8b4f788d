"""Detection of a current or a speed that wraps: it overflows the number in which it is logged.

Beyond the limit of an integer, such as 32,767 of 16 bit, the log starts again at the other limit.
It then jumps by the range of the number, and

- all jumps of the run have this size, but for a step as between other samples,
- no value is outside the range,
- the motor moves on beyond the limit, as it does not where a sensor fails, and
- the voltage balance v = R i + K w + L di/dt holds without the jumps and not with them.

A speed that is sampled more slowly than it reverses jumps as well; there the balance holds with
the jumps.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import CHANNELS, Signals
from identification.checks.finding import Finding, refusal, restarted
from identification.checks.limited import noise_of
from identification.ingest.run import Run

__all__ = ["wrapped_findings"]

_JUMP: Final = 0.5
"""Step of a jump, over the span of the log."""
_FEWEST: Final = 2
"""Fewest jumps: the signal leaves the range and comes back."""
_LARGEST_STEP: Final = 0.4
"""Largest other step over the range; beyond it the direction would be ambiguous."""
_MOVED: Final = 10.0
"""Least movement in each part, over the noise: noise alone moves by six or seven."""
_WHOLE: Final = 0.01
"""Largest distance of a step from a multiple of the resolution, over the latter."""
_NEAR: Final = 0.01
"""Largest relative difference between the range of an integer and the estimate from the jumps."""
_MISSED: Final = 0.03
"""Fraction of the voltage that the log with its jumps leaves unexplained at least."""
_BETTER: Final = 0.35
"""Largest ratio of the unexplained fractions without and with the jumps."""


def wrapped_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Findings for a current or a speed that wraps at the limits of its number."""
    for column in ("current_A", "speed_rad_s"):
        signal = getattr(signals, CHANNELS[column])
        size = _range_of(signal)
        if size is None:
            continue
        found = np.unwrap(signal, period=size)
        is_current = column == "current_A"
        unwrapped = replace(signals, current=found) if is_current else replace(signals, speed=found)
        before, after = _missed(signals), _missed(unwrapped)
        if before > _MISSED and after < _BETTER * before:
            yield _finding(run, column, signal, size, (before, max(after / _BETTER, _MISSED)))


def _finding(
    run: Run, column: str, signal: Array, size: float, missed: tuple[float, float]
) -> Finding:
    jumps = np.flatnonzero(np.abs(np.diff(signal)) > _JUMP * size)
    first, unit = int(jumps[0]), "A" if column == "current_A" else "rad/s"
    return refusal(
        "wrapped_channel",
        run,
        column,
        f"wraps: it jumps {jumps.size} times by about {size:.5g} {unit}, first from "
        f"{signal[first]:.5g} to {signal[first + 1]:.5g} {unit} at {run.time[first + 1]:.6g} s, "
        "and the voltage balance holds only without the jumps; the value overflows the number in "
        f"which it is logged, at {float(signal.min()):.5g} and {float(signal.max()):.5g} {unit}",
        ("unexplained fraction of the voltage variance", *missed),
        restarted(run, column, size),
    )


def _range_of(signal: Array) -> float | None:
    """Range of the number in which a signal (n_sample,) wraps; None if it does not."""
    steps, span = np.diff(signal), float(np.ptp(signal))
    jumps = np.abs(steps) > _JUMP * span
    if np.count_nonzero(jumps) < _FEWEST:
        return None
    others = np.abs(steps[~jumps])
    largest = float(np.max(others, initial=0.0))
    # The signal moves within a jump too, as far as it does beside it.
    inner = np.flatnonzero(jumps[1:-1] & ~jumps[:-2] & ~jumps[2:]) + 1
    if not inner.size:
        return None
    sizes = np.abs(steps[inner] - 0.5 * (steps[inner - 1] + steps[inner + 1]))
    size = max(float(np.median(sizes)), span)
    is_equal = np.all(np.abs(np.abs(steps[jumps]) - size) <= 2.0 * largest)
    if not is_equal or largest >= _LARGEST_STEP * size or not _moves_on(signal, size):
        return None
    return _exact(size, steps)


def _moves_on(signal: Array, size: float) -> bool:
    """True if the signal (n_sample,) moves within the range and beyond its limits."""
    continued = np.unwrap(signal, period=size)
    turns = np.round((continued - signal) / size)
    parts = [continued[turns == turn] for turn in np.unique(turns)]
    return all(np.ptp(part) > _MOVED * noise_of(continued) for part in parts)


def _exact(size: float, steps: Array) -> float:
    """The range as a power of two of the resolution that the steps (n_sample - 1,) show, if any."""
    moved = np.abs(steps[steps != 0.0])
    resolution = float(np.min(moved))
    counts = moved / resolution
    exact = resolution * 2.0 ** np.round(np.log2(size / resolution))
    is_resolved = np.max(np.abs(counts - np.round(counts))) < _WHOLE
    return float(exact) if is_resolved and abs(exact / size - 1.0) < _NEAR else size


def _missed(signals: Signals) -> float:
    """Least unexplained fraction of the voltage over the window lengths, with positive R and K."""
    fits = [fit for balance in signals.balances if (fit := balance.electrical) is not None]
    return min((fit.missed for fit in fits if np.all(fit.values[:2] > 0.0)), default=1.0)
