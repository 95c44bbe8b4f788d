"""Detection of recordings that were joined without a gap in the time.

A linear motor under a held or sloped voltage obeys, exactly and at any interval,

    w[k+1] = a w[k] + b i[k] + c v[k] + d v[k+1] + f sign(w[k]) + g

Recordings are joined between two samples if all of these hold:

- the residual of this regression is an outlier and most of the change of speed, in this interval
  and together with either neighbour, as it is not at a spike of the sensor;
- the residuals beside it are no outliers, as they are where backlash ends;
- J / h times the residual, the unexplained torque, exceeds what the largest current of the run
  makes: a voltage step at an unknown instant within the interval h explains no more;
- the back-EMF, v - R i - L di/dt, confirms the new speed, as it does not if the sensor fails.

Only a blow to the shaft, such as an end stop, does the same.  A simulation across either is wrong,
and one that starts again at the new speed is right.

Source: Ljung, System Identification, 2nd edition (1999), section 14.3 (outliers and merged data).
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import Regression, Signals, predicted, signals_of
from identification.checks.finding import Finding, suspicion
from identification.ingest.run import Run

__all__ = ["Joint", "divided", "joined_finding", "joints_of"]

_DEVIATIONS: Final = 10.0
"""Residual over its standard deviation from which it is an outlier."""
_TRIMMED: Final = 0.01
"""Fraction of the residuals, the largest, that does not count in the regression."""
_BESIDE: Final = 3.0
_SHARE: Final = 0.1
"""Largest residuals beside a joint: over their standard deviation, or over that of the joint."""
_MOST: Final = 0.5
"""Largest difference between a change of speed and the residual of a joint, over the latter."""
_TORQUE: Final = 1.0
"""Least unexplained torque over that of the largest current."""
_NEAR: Final = 9
"""Samples on either side whose median gives the error of the voltage balance."""
_CONFIRMED: Final = 0.5
"""Largest change of this error, over the back-EMF of the residual; one if the sensor fails."""
_FEWEST: Final = 100
_RESOLUTION: Final = 1e-4
"""Least noise of a speed over its largest value; a jump of ten times this is harmless."""


@dataclass(frozen=True)
class Joint:
    """A place at which recordings were joined."""

    sample: int
    """First sample after the joint."""
    torque: float
    """Unexplained torque over that of the largest current [-]."""


def divided(run: Run, joints: Sequence[Joint]) -> Run:
    """The run with a segment for each of the recordings that were joined in it."""
    starts = [joint.sample for joint in joints]
    if not starts:
        return run
    segments: list[tuple[int, int]] = []
    for start, stop in run.segments:
        edges = [start, *(sample for sample in starts if start < sample < stop), stop]
        segments += itertools.pairwise(edges)
    return dataclasses.replace(run, segments=tuple(segments))


def joined_finding(run: Run, joints: Sequence[Joint]) -> Finding:
    """Suspicion that a run is several recordings, joined at one place at least."""
    worst = max(joints, key=lambda joint: joint.torque)
    k = worst.sample
    more = f" ({len(joints)} such places)" if len(joints) > 1 else ""
    return suspicion(
        "joined_recordings",
        run,
        "speed_rad_s",
        f"jumps from {run.speed[k - 1]:.4g} to {run.speed[k]:.4g} rad/s at "
        f"{run.time[k]:.6g} s{more}, which no current of this run could do within a sample, and "
        "the voltage and the current confirm it: recordings were joined there, or the shaft was "
        f"struck; the fit divides the run there, into {len(joints) + len(run.segments)} records",
        ("unexplained torque relative to that of the largest current", worst.torque, _TORQUE),
        remedy="export each recording to a file of its own, or keep the pauses in the time",
    )


def joints_of(run: Run) -> list[Joint]:
    """Places at which recordings were joined, in order of time."""
    signals = signals_of(run, samples=run.rows)
    is_constant = np.ptp(run.speed) == 0.0 or np.ptp(run.current) == 0.0
    if is_constant or np.count_nonzero(signals.joined) < _FEWEST:
        return []
    residual, deviation = _one_step(signals)
    size = np.abs(residual)
    beside = np.full(size.size, np.inf)
    beside[1:-1] = np.maximum(size[2:], size[:-2])
    is_alone = beside < np.maximum(_BESIDE * deviation, _SHARE * size)
    is_jump = np.abs(np.diff(signals.speed) - residual) < _MOST * size
    over_two = signals.speed[2:] - signals.speed[:-2]
    is_jump[:-1] &= np.abs(over_two - residual[:-1]) < _MOST * size[:-1]
    is_jump[1:] &= np.abs(over_two - residual[1:]) < _MOST * size[1:]
    is_odd = signals.joined & (size > _DEVIATIONS * deviation)
    places = np.flatnonzero(is_odd & is_alone & is_jump).tolist()
    balance = _balance(signals) if places else None
    if balance is None:
        return []
    resistance, constant, inductance, inertia = balance
    torque = inertia * size / np.diff(run.time) / float(np.max(np.abs(run.current)))
    left = run.voltage - resistance * signals.current - constant * signals.speed
    left -= inductance * np.gradient(signals.current, run.time)
    return [
        Joint(k + 1, float(torque[k]))
        for k in places
        if torque[k] > _TORQUE and _change(left, k) < _CONFIRMED * constant * size[k]
    ]


def _one_step(signals: Signals) -> tuple[Array, Array]:
    """Residuals (n_sample - 1,) of the regression over neighbouring samples, and their deviations.

    Where the voltage takes a value that it has nowhere else, the regression predicts nothing, and
    the deviation is large.  Residuals that are not joined are zero.
    """
    v, i, w = signals.voltage, signals.current, signals.speed
    largest = float(np.abs(w).max())
    sign = np.clip(w / (0.02 * largest), -1.0, 1.0)
    columns = (w[:-1], i[:-1], v[:-1], v[1:], sign[:-1], np.ones(w.size - 1))
    first = np.abs(w[1:] - predicted(columns, w[1:], signals.joined, 0.0)[0])
    usual = np.quantile(first[signals.joined], 1.0 - _TRIMMED)
    kept = signals.joined & (first <= usual)
    speed, deviation = predicted(columns, w[1:], kept, _RESOLUTION * largest)
    return np.where(signals.joined, w[1:] - speed, 0.0), deviation


def _balance(signals: Signals) -> tuple[float, float, float, float] | None:
    """R [ohm], K [V s/rad], L [H] and J / K [A s^2/rad]; None if they are not physical.

    Each balance is taken over the windows that explain it best.  A joint makes J / K smaller, so
    that fewer joints are found and not more.
    """
    balances = signals.balances
    electrical = _best([balance.electrical for balance in balances])
    mechanical = _best([balance.mechanical for balance in balances])
    if electrical is None or mechanical is None:
        return None
    resistance, constant, inductance = electrical[:3].tolist()
    inertia = float(mechanical[0])
    if min(resistance, constant, inertia) <= 0.0:
        return None
    return resistance, constant, inductance, inertia


def _best(fits: list[Regression | None]) -> Array | None:
    """Coefficients of the fit that explains most; None if there is no fit."""
    found = [fit for fit in fits if fit is not None]
    return min(found, key=lambda fit: fit.missed).values if found else None


def _change(signal: Array, k: int) -> float:
    """Size of the change of a signal (n_sample,) between samples k and k + 1, by medians."""
    after, before = signal[k + 1 : k + 1 + _NEAR], signal[max(k + 1 - _NEAR, 0) : k + 1]
    return float(abs(np.median(after) - np.median(before)))
