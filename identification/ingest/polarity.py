"""Polarity check by window-averaged least squares: reversed or unsigned current and speed sensors.

Averaged over a window of length T, the electrical and mechanical balances of a motor are exact and
linear if dry friction and load torque are neglected,

    v = R i + K w + L (i_end - i_begin) / T
    i = (b w + J (w_end - w_begin) / T) / K

with positive coefficients.  A reversed sensor gives a negative coefficient in a fit of the first
equation.  A sensor that logs magnitudes is detected in runs in which the voltage reverses: the
balance has a large residual, which drops when the sign of that channel is restored.  A channel that
keeps its sign while the voltage reverses is not sufficient evidence: a braked motor keeps turning
for a while, and the current of a hoist has the same sign up and down.  Window averages need no
derivative and reduce the noise; two window lengths cover fast and slow motors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from identification.arrays import Array
from identification.ingest.run import RunWarning, SourceLocator

__all__ = ["check_polarity"]

# A sensor keeps its polarity within a run, so the beginning of a long run is sufficient.
_SAMPLES = 200_000
_WINDOW_SAMPLES = 16
_WINDOWS = 100
_FEWEST_WINDOWS = 15

# Largest opposite-sign share of the peak for a channel to count as one-signed.
_REVERSAL = 0.1
# Valid runs leave a smaller share of the mean square unexplained; a magnitude leaves more.
_LEAST_UNEXPLAINED = 0.05
_BETTER = 0.75
# Smallest contribution to the voltage (rms ratio) and smallest number of standard errors for a
# coefficient to count as negative.
_LEAST_SHARE = 0.05
_LEAST_ERRORS = 10.0
_MOST_UNEXPLAINED = 0.3
# If current and speed are proportional, the fit cannot separate their shares of the voltage.
_MOST_COLLINEAR = 0.95


def check_polarity(
    channels: dict[str, Array], time: Array, locator: SourceLocator
) -> Iterator[RunWarning]:
    """Warn of inconsistent signs of voltage, current and speed, in SI units."""
    time = time[:_SAMPLES]
    names = ("voltage_V", "current_A", "speed_rad_s")
    voltage, current, speed = (channels[name][:_SAMPLES] for name in names)
    if not (np.ptp(voltage) and np.ptp(current) and np.ptp(speed)):
        return
    lengths = {_WINDOW_SAMPLES, max(_WINDOW_SAMPLES, time.size // _WINDOWS)}
    balances = [
        _Balance(_Windows(time, length), voltage, current, speed)
        for length in sorted(lengths)
        if time.size > _FEWEST_WINDOWS * length
    ]
    unsigned = {name for balance in balances for name in balance.unsigned()}
    turned = set() if unsigned else {name for balance in balances for name in balance.reversed()}
    for name in channels:
        if name in unsigned:
            yield locator.warning(
                "unsigned_channel",
                "keeps one sign while the voltage reverses, and agrees with the other channels "
                "only with the sign restored; log the signed value, a motor cannot be identified "
                "from magnitudes",
                name,
            )
        if name in turned:
            yield locator.warning(
                "opposite_signs",
                "has the wrong sign according to the voltage and the other channel; "
                "check the polarity of the three sensors",
                name,
            )


class _Windows:
    """Division of a record into windows of equal numbers of samples."""

    def __init__(self, time: Array, length: int) -> None:
        self._step = np.diff(time)
        self._edges = np.arange((time.size - 1) // length + 1) * length
        self._duration = np.diff(time[self._edges])

    def mean(self, signal: Array) -> Array:
        """Mean over each window by the trapezoidal rule, (n_window,)."""
        area = np.cumsum(0.5 * (signal[1:] + signal[:-1]) * self._step)
        return np.diff(np.concatenate(([0.0], area))[self._edges]) / self._duration

    def rate(self, signal: Array) -> Array:
        """Difference between the ends of each window, divided by its duration, (n_window,)."""
        return np.diff(signal[self._edges]) / self._duration


@dataclass(frozen=True)
class _Balance:
    """Electrical and mechanical balance of one run, for one window length."""

    windows: _Windows
    voltage: Array
    current: Array
    speed: Array

    def unsigned(self) -> list[str]:
        """Channels that appear to hold magnitudes."""
        if not _reverses(self.voltage):
            return []
        found = []
        sign = np.sign(self.voltage)
        if not _reverses(self.current):
            speed = self.speed if _reverses(self.speed) else sign * self.speed
            as_logged, with_sign = (self.current, speed), (sign * self.current, speed)
            if _fits_better(self._unexplained_voltage, as_logged, with_sign):
                found.append("current_A")
        if not _reverses(self.speed):
            current = self.current if _reverses(self.current) else sign * self.current
            as_logged = (current, self.speed)
            by_voltage, by_current = sign * self.speed, np.sign(current) * self.speed
            if _fits_better(
                self._unexplained_voltage, as_logged, (current, by_voltage)
            ) or _fits_better(self._unexplained_current, as_logged, (current, by_current)):
                found.append("speed_rad_s")
        return found

    def reversed(self) -> list[str]:
        """Channels whose coefficient in the voltage balance is significantly negative."""
        current, speed = self.windows.mean(self.current), self.windows.mean(self.speed)
        target = self.windows.mean(self.voltage)
        fit = _fit(target, current, speed, self.windows.rate(self.current))
        if fit is None or fit.unexplained > _MOST_UNEXPLAINED:
            return []
        if _collinearity(current, speed) > _MOST_COLLINEAR:
            return []
        return [
            name
            for name, k, signal in (("current_A", 0, current), ("speed_rad_s", 1, speed))
            if fit.values[k] < -_LEAST_ERRORS * fit.errors[k]
            and fit.values[k] * _rms(signal) < -_LEAST_SHARE * _rms(target)
        ]

    def _unexplained_voltage(self, current: Array, speed: Array) -> float:
        w = self.windows
        fit = _fit(w.mean(self.voltage), w.mean(current), w.mean(speed), w.rate(current))
        return fit.unexplained if fit else 0.0

    def _unexplained_current(self, current: Array, speed: Array) -> float:
        fit = _fit(self.windows.mean(current), self.windows.mean(speed), self.windows.rate(speed))
        return fit.unexplained if fit else 0.0


def _reverses(signal: Array) -> bool:
    high, low = float(np.max(signal)), float(np.min(signal))
    return min(high, -low) > _REVERSAL * max(high, -low)


def _fits_better(
    unexplained: Callable[[Array, Array], float],
    as_logged: tuple[Array, Array],
    with_sign: tuple[Array, Array],
) -> bool:
    """Return True if the residual is large as logged and much smaller with the sign restored."""
    before = unexplained(*as_logged)
    return before > _LEAST_UNEXPLAINED and unexplained(*with_sign) < _BETTER * before


@dataclass(frozen=True)
class _Fit:
    """Coefficients, standard errors and unexplained share of the mean square of a linear fit."""

    values: Array
    errors: Array
    unexplained: float


def _fit(target: Array, *regressors: Array) -> _Fit | None:
    """Ordinary least squares; None if the regressors are linearly dependent."""
    matrix = np.column_stack(regressors)
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    power = float(target @ target)
    if power == 0.0 or not np.all(scale > 0.0):
        return None
    scaled = matrix / scale
    values, _, rank, _ = np.linalg.lstsq(scaled, target, rcond=1e-9)
    if rank < len(regressors):
        return None
    residual = target - scaled @ values
    squares = float(residual @ residual)
    errors = np.sqrt(squares / target.size * np.diag(np.linalg.pinv(scaled.T @ scaled)))
    return _Fit(values / scale, errors / scale, squares / power)


def _collinearity(first: Array, second: Array) -> float:
    """Absolute cosine of the angle between two signals."""
    lengths = float(np.linalg.norm(first) * np.linalg.norm(second))
    return abs(float(first @ second)) / lengths if lengths else 1.0


def _rms(signal: Array) -> float:
    return float(np.sqrt(np.mean(signal**2)))
