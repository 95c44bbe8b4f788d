"""Signs that contradict each other: a sensor the wrong way round, or one without a sign.

Averaged over a window of length T, the two balances of a motor are exact and linear,

    v = R i + K w + L (i_end - i_begin) / T
    i = (b w + J (w_end - w_begin) / T) / K

with positive coefficients.  A fit of the first shows a reversed sensor as a negative coefficient.
A sensor that gives magnitudes only shows in a drive that reverses: the balance is missed by far,
and fits much better once a sign is put in front of that channel.  That a channel keeps its sign
while the voltage reverses is no proof by itself: a motor that is braked turns on for a while, and
the current of a hoist keeps its sign up and down.  Windows rather than samples, since they need
no derivative and average the noise; two lengths of them, for fast motors and for slow ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.ingest.place import Places
from identification.ingest.run import RunWarning

__all__ = ["check_polarity"]

Array = NDArray[np.float64]

# A sensor does not change its sign within a run, so the beginning of a long one is enough.
_SAMPLES = 200_000
_WINDOW_SAMPLES = 16
_WINDOWS = 100
_FEWEST_WINDOWS = 15

# A channel counts as never negative, and a voltage as reversing, up to this share of its peak.
_REVERSAL = 0.1
# Sound runs leave less than this share of the balance unexplained; a magnitude leaves more.
_MISSED = 0.05
_BETTER = 0.75
# Smallest share of the voltage, and of standard errors, for a coefficient to be called negative.
_LEAST_SHARE = 0.05
_LEAST_ERRORS = 10.0
_MOST_UNEXPLAINED = 0.3
# Current and speed in proportion leave open which of them carries the voltage.
_MOST_ALIKE = 0.95


def check_polarity(channels: dict[str, Array], time: Array, places: Places) -> list[RunWarning]:
    """Compare the signs of voltage, current and speed.

    Args:
        channels: Channel name to (n_sample,), in SI units.
        time: (n_sample,) strictly increasing [s].
        places: Where the samples stand.

    Returns:
        Warnings.
    """
    time = time[:_SAMPLES]
    names = ("voltage_V", "current_A", "speed_rad_s")
    voltage, current, speed = (channels[name][:_SAMPLES] for name in names)
    if not (np.ptp(voltage) and np.ptp(current) and np.ptp(speed)):
        return []
    lengths = {_WINDOW_SAMPLES, max(_WINDOW_SAMPLES, time.size // _WINDOWS)}
    balances = [
        _Balance(_Windows(time, length), voltage, current, speed)
        for length in sorted(lengths)
        if time.size > _FEWEST_WINDOWS * length
    ]
    unsigned = {name for balance in balances for name in balance.unsigned()}
    if unsigned:
        return [_unsigned_warning(name, places) for name in channels if name in unsigned]
    turned = {name for balance in balances for name in balance.reversed()}
    return [_reversed_warning(name, places) for name in channels if name in turned]


def _unsigned_warning(name: str, places: Places) -> RunWarning:
    return places.warning(
        "unsigned_channel",
        "keeps one sign while the drive reverses, and agrees with the other channels only with "
        "a sign put back; log the signed value, a motor cannot be identified from a magnitude",
        name,
    )


def _reversed_warning(name: str, places: Places) -> RunWarning:
    return places.warning(
        "opposite_signs",
        "has the opposite sign of what voltage and the other channel ask for; "
        "check the polarity of the three sensors",
        name,
    )


class _Windows:
    """Cuts a record into windows of equally many samples."""

    def __init__(self, time: Array, length: int) -> None:
        self._step = np.diff(time)
        self._edges = np.arange((time.size - 1) // length + 1) * length
        self._duration = np.diff(time[self._edges])

    def mean(self, signal: Array) -> Array:
        """Mean over each window by the trapezoidal rule, (n_window,)."""
        area = np.cumsum(0.5 * (signal[1:] + signal[:-1]) * self._step)
        return np.diff(np.concatenate(([0.0], area))[self._edges]) / self._duration

    def rate(self, signal: Array) -> Array:
        """Change from begin to end of each window over its length, (n_window,)."""
        return np.diff(signal[self._edges]) / self._duration


@dataclass(frozen=True)
class _Balance:
    """The balances of one run over windows of one length."""

    windows: _Windows
    voltage: Array
    current: Array
    speed: Array

    def unsigned(self) -> list[str]:
        """Channels that hold magnitudes."""
        if not _reverses(self.voltage):
            return []
        found = []
        sign = np.sign(self.voltage)
        if not _reverses(self.current):
            speed = self.speed if _reverses(self.speed) else sign * self.speed
            if _fits_better(
                self._voltage_missed, (self.current, speed), (sign * self.current, speed)
            ):
                found.append("current_A")
        if not _reverses(self.speed):
            current = self.current if _reverses(self.current) else sign * self.current
            if _fits_better(
                self._voltage_missed, (current, self.speed), (current, sign * self.speed)
            ) or _fits_better(
                self._current_missed,
                (current, self.speed),
                (current, np.sign(current) * self.speed),
            ):
                found.append("speed_rad_s")
        return found

    def reversed(self) -> list[str]:
        """Channels of which the voltage balance has a clearly negative coefficient."""
        current, speed = self.windows.mean(self.current), self.windows.mean(self.speed)
        target = self.windows.mean(self.voltage)
        fit = _fit(target, current, speed, self.windows.rate(self.current))
        if fit is None or fit.missed > _MOST_UNEXPLAINED or _alike(current, speed) > _MOST_ALIKE:
            return []
        return [
            name
            for name, k, signal in (("current_A", 0, current), ("speed_rad_s", 1, speed))
            if fit.values[k] < -_LEAST_ERRORS * fit.errors[k]
            and fit.values[k] * _rms(signal) < -_LEAST_SHARE * _rms(target)
        ]

    def _voltage_missed(self, current: Array, speed: Array) -> float:
        w = self.windows
        fit = _fit(w.mean(self.voltage), w.mean(current), w.mean(speed), w.rate(current))
        return fit.missed if fit else 0.0

    def _current_missed(self, current: Array, speed: Array) -> float:
        fit = _fit(self.windows.mean(current), self.windows.mean(speed), self.windows.rate(speed))
        return fit.missed if fit else 0.0


def _reverses(signal: Array) -> bool:
    high, low = float(np.max(signal)), float(np.min(signal))
    return min(high, -low) > _REVERSAL * max(high, -low)


def _fits_better(
    missed: Callable[[Array, Array], float],
    as_logged: tuple[Array, Array],
    with_sign: tuple[Array, Array],
) -> bool:
    """Whether a balance is missed as logged, and much less so with a sign put back."""
    before = missed(*as_logged)
    return before > _MISSED and missed(*with_sign) < _BETTER * before


@dataclass(frozen=True)
class _Fit:
    """Coefficients of a linear fit, their standard errors, and the share left unexplained."""

    values: Array
    errors: Array
    missed: float


def _fit(target: Array, *regressors: Array) -> _Fit | None:
    """Least squares of the target; None where the regressors are not independent."""
    matrix = np.column_stack(regressors)
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    power = float(target @ target)
    if power == 0.0 or not np.all(scale > 0.0):
        return None
    values, _, rank, _ = np.linalg.lstsq(matrix / scale, target, rcond=1e-9)
    if rank < len(regressors):
        return None
    rest = target - matrix / scale @ values
    spread = float(rest @ rest) / target.size
    errors = np.sqrt(spread * np.diag(np.linalg.pinv((matrix / scale).T @ (matrix / scale))))
    return _Fit(values / scale, errors / scale, float(rest @ rest) / power)


def _alike(first: Array, second: Array) -> float:
    lengths = float(np.linalg.norm(first) * np.linalg.norm(second))
    return abs(float(first @ second)) / lengths if lengths else 1.0


def _rms(signal: Array) -> float:
    return float(np.sqrt(np.mean(signal**2)))
