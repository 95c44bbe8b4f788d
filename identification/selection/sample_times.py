"""Consider covariance of samples that are taken earlier or later than their logged times.

A program that reads the channels when the operating system lets it, and logs the planned times,
has errors u of its sample times, of standard deviation s.  With the slope y' of a channel and its
noise n, the residual and its variance are, to first order,

    e = u y' + n,      var e = var n + s^2 y'^2,

Iterated weighted regression of e^2 on y'^2 gives s.
The time errors are reported if that raises the log likelihood of normal residuals by more than
chance, which is more for noise with heavy tails, and if the residual is hardly correlated from
sample to sample where the slope is large, as that of a missing law is.

Time errors do not only scatter.  At a step of the voltage, where y' jumps by D, late samples show
the response and early ones do not, so that the mean residual there is D E[max(u, 0)], at most
D s / 2 by Jensen's inequality.  A fit explains it by a delay and another inductance.  This bound on
the mean is one standard deviation of an error that joins the intervals, to first order.

Source: Balakrishnan, IRE Transactions on Information Theory 8 (1962), 226-236 (time jitter in
sampling); Davidian and Carroll, J. American Statistical Association 82 (1987), 1079-1091 (variance
function estimation); Schwarz, Annals of Statistics 6 (1978), 461-464 (gain by chance); White,
Econometrica 50 (1982), 1-25 (likelihood ratio of a wrong distribution); Schmidt, in Advances in
Control Systems 3 (1966), 293-340 (consider covariance).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.arrays import Array, Bool
from identification.fit.solve import Fit
from identification.selection.omitted import OmittedTerm, independent, optimum_shifts

__all__ = ["SAMPLE_TIMES", "sample_time_errors", "time_deviations"]

SAMPLE_TIMES: Final = "sample_times"
"""Name of the terms."""

_STEPS: Final = 20
"""Iterations of the regression, each of which reduces its error several times."""
_FEWEST: Final = 100
"""Fewest samples of a channel."""
_CORRELATED: Final = 0.25
"""Largest correlation of the residual from sample to sample: the square of the bound 1/2 on its
mean over its deviation."""


def sample_time_errors(fit: Fit, fraction: float) -> tuple[OmittedTerm, ...]:
    """Parameter changes by uncertain sample times; none if the residual shows no time errors.

    `fraction` is the effective sample fraction, by which the intervals are corrected already [-].
    """
    deviations = time_deviations(fit, fraction)
    if not deviations.any():
        return ()
    changes = []
    for record, simulated in zip(fit.simulator.records, fit.simulated(), strict=True):
        bends = np.zeros((*simulated.shape, 1))
        bends[1:-1, :, 0] = np.diff(_slopes(record.time, simulated), axis=0)
        changes.append(0.5 * deviations[:, None] * bends)
    total = np.sum(optimum_shifts(fit, changes), axis=0)
    return independent(fit, fraction, SAMPLE_TIMES, total)


def time_deviations(fit: Fit, fraction: float) -> Array:
    """Standard deviation of the sample times of each channel (2,) [s]; 0 where none is seen."""
    found = np.zeros(2)
    for channel in range(2):
        residuals, squares, follows = [], [], []
        for record, simulated in zip(fit.simulator.records, fit.simulated(), strict=True):
            used = record.weight[1:-1, channel] > 0.0
            steps = _slopes(record.time, simulated)[:, channel]
            left = record.measured[:, channel] - simulated[:, channel]
            # Towards a positive slope, so that a time error has the same sign in both directions.
            signs = np.sign(steps[1:] + steps[:-1])[used]
            residuals.append(left[1:-1][used] * signs)
            squares.append(0.5 * (steps[1:] ** 2 + steps[:-1] ** 2)[used])
            follows.append(np.arange(used.sum()) > 0)
        found[channel] = _time_deviation(
            np.concatenate(residuals), np.concatenate(squares), np.concatenate(follows), fraction
        )
    return found


def _slopes(time: Array, simulated: Array) -> Array:
    """(n_sample - 1, 2) slopes of the simulated channels [A/s, rad/s^2]."""
    return np.asarray(np.diff(simulated, axis=0) / np.diff(time)[:, None])


def _time_deviation(residual: Array, squares: Array, follows: Bool, fraction: float) -> float:
    """Standard deviation of the sample times of one channel [s]; 0 if none is seen.

    The residuals (n_sample,) have the sign of the time error, and the squares of the slopes are
    (n_sample,); `follows` is True at samples with another one of the same record before them.
    """
    number, power = residual.size, residual**2
    if number < _FEWEST or not squares.any() or not power.any():
        return 0.0
    least, scale = 1e-6 * float(power.mean()), float(squares.mean())
    columns = np.column_stack([np.ones(number), squares / scale])
    variance = np.full(number, float(power.mean()))
    values = np.zeros(2)
    for _ in range(_STEPS):
        weighted = columns / variance[:, None]
        values = np.linalg.lstsq(weighted, power / variance, rcond=1e-12)[0]
        variance = np.maximum(columns @ np.maximum(values, 0.0), least)
    constant = np.log(float(power.mean())) + 1.0
    gain = 0.5 * fraction * float(np.sum(constant - np.log(variance) - power / variance))
    # By chance, the gain grows with the variance of the squares, which is 2 for a normal variable.
    scatter = max(0.5 * (float(np.mean((power / variance) ** 2)) - 1.0), 1.0)
    if not (values[1] > 0.0 and gain > 0.5 * np.log(number) * scatter):
        return 0.0
    late = residual * values[1] * columns[:, 1] / variance**1.5
    common = float(np.sum((late[1:] * late[:-1])[follows[1:]]))
    if common > _CORRELATED * float(np.sum(late**2)):
        return 0.0
    return float(np.sqrt(values[1] / scale))
