"""Channels of noise only, by two tests that hold for records of any length.

A channel of white noise has

    lag-1 autocorrelation r1 of variance 1/n
    F = (R^2 / p) / ((1 - R^2) / (n - p - 1)), distributed as F(p, n - p - 1)

where R^2 is the explained fraction of the channel, regressed on p signals that are independent of
it, of any autocorrelation.  A channel is called noise if neither is significant: a drive that
switches at random at each sample is white as well, but current and speed respond to it.

Source: Anderson, The Distribution of the Serial Correlation Coefficient, Annals of Mathematical
Statistics 13 (1942), 1-13; F test of the linear model with normal errors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.special import fdtrc

from identification.arrays import Array
from identification.checks.balance import Signals, mean_square
from identification.checks.finding import Finding
from identification.ingest.run import Run

__all__ = ["NOISE_PROBABILITY", "is_noise", "noise_probability", "unlogged_voltage_findings"]

NOISE_PROBABILITY: Final = 1e-3
"""Probability of a larger F below which a channel is no noise."""
_DEVIATIONS: Final = 3.0
"""Standard deviations of r1 above which a channel is no noise; one-sided probability 0.0013."""
_FEWEST: Final = 30
_SMOOTH: Final = 0.9
"""Autocorrelation above which less than a tenth of the variance of a speed is noise."""
_UNEXPLAINED: Final = 0.6


def is_noise(signals: Signals, channel: str) -> bool:
    """True if a channel is constant, or white and independent of the other two."""
    target = getattr(signals, channel)
    if np.ptp(target) == 0.0:
        return True
    is_white = _autocorrelation(target) < _DEVIATIONS / math.sqrt(target.size)
    return is_white and noise_probability(signals, channel) > NOISE_PROBABILITY


def noise_probability(signals: Signals, channel: str) -> float:
    """Probability that noise is explained as well as a channel is by the other two; 1 if unknown.

    The regressors are the other channels at the previous, the same and the next sample.
    """
    others = [getattr(signals, n) for n in ("voltage", "current", "speed") if n != channel]
    regressors = [shifted for other in others for shifted in (other[:-2], other[1:-1], other[2:])]
    target = getattr(signals, channel)[1:-1]
    missed, used = _missed(target, regressors)
    freedom = target.size - used - 1
    if used == 0 or freedom < 1:
        return 1.0
    return float(fdtrc(used, freedom, (1.0 - missed) / used / (max(missed, 1e-12) / freedom)))


def unlogged_voltage_findings(run: Run, signals: Signals) -> list[Finding]:
    """Suspicion that a voltage was not logged: the motor does not run at the constant voltage.

    At a constant voltage v, current and speed obey K w = v - R i - L di/dt.
    """
    speed = signals.speed
    if speed.size < _FEWEST or _autocorrelation(speed) < _SMOOTH:
        return []
    if np.std(speed) < 0.1 * float(np.max(np.abs(speed))) or not is_noise(signals, "voltage"):
        return []
    missed, _ = _missed(speed, [signals.current, np.gradient(signals.current, signals.time)])
    if missed < _UNEXPLAINED:
        return []
    return [
        Finding(
            "unlogged_voltage",
            "suspect",
            run.name,
            "voltage_V",
            f"is constant apart from noise ({float(np.mean(signals.voltage)):.4g} V) while the "
            "speed changes, and the current does not fit a constant voltage; check that the "
            "voltage at the motor terminals was logged",
            "fraction of the speed variance that a constant voltage leaves unexplained",
            missed,
            _UNEXPLAINED,
            remedy="log the voltage at the motor terminals",
        )
    ]


def _autocorrelation(signal: Array) -> float:
    """Lag-1 autocorrelation, zero for a constant."""
    centred = signal - signal.mean()
    size = mean_square(centred)
    return float(np.mean(centred[1:] * centred[:-1])) / size if size > 0.0 else 0.0


def _missed(target: Array, regressors: Sequence[Array]) -> tuple[float, int]:
    """Unexplained fraction of a target and number of independent regressors."""
    matrix = np.column_stack(regressors)
    matrix = matrix - matrix.mean(axis=0)
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    matrix = matrix[:, scale > 0.0] / scale[scale > 0.0]
    centred = target - target.mean()
    size = mean_square(centred)
    if not matrix.size or size <= 0.0:
        return 1.0, 0
    values, _, rank, _ = np.linalg.lstsq(matrix, centred, rcond=1e-8)
    return mean_square(centred - matrix @ values) / size, int(rank)
