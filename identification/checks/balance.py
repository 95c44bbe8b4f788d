"""Regression on the electrical and mechanical balances, integrated over windows.

Integrated over a window of length T, the balances are linear in the logged signals,

    v = R i + K w + L (i_end - i_begin) / T + u sign(i) + v0
    i = (J (w_end - w_begin) / T + b w + c sign(w) + m) / K

so that no derivative is needed and noise averages out.  Brush drop u, dry friction c and the
offsets v0 and m have their own regressors and do not bias the other coefficients.

Standard errors come from a jackknife over contiguous blocks, which is valid for autocorrelated
residuals (Kunsch, Annals of Statistics 17 (1989), 1217-1241).  Noise of the regressors biases
regressors that are nearly collinear, which no residual shows (errors in variables); the standard
errors include this bias.  R and K that change with the temperature bias them too; a regression with
R and K linear in it shows how much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from identification.arrays import Array, Bool, Index
from identification.differences import difference_noise
from identification.ingest.run import Run
from identification.linear import solution

__all__ = [
    "CHANNELS",
    "NO_VOLTAGE",
    "Balance",
    "Regression",
    "Signals",
    "Windows",
    "has_signal",
    "is_constant",
    "mean_square",
    "predicted",
    "regress",
    "reverses",
    "signals_of",
    "windows_of",
]

CHANNELS: Final = {"voltage_V": "voltage", "current_A": "current", "speed_rad_s": "speed"}
"""Field of `Run` and `Signals` by the canonical name of the channel."""
NO_VOLTAGE: Final = 0.01
"""Largest voltage of a motor that is not driven, over the highest voltage of the run."""
SAMPLES: Final = 200_000
"""Largest number of samples checked per run; a faulty sensor is faulty from the beginning."""
_WINDOW_SAMPLES: Final = 8
_WINDOWS: Final = 120
_FEWEST_WINDOWS: Final = 30
_BLOCKS: Final = 10
_NOISE_WINDOW: Final = 16
_NOISE_TIMES: Final = 4.0
_CONSTANT: Final = 0.01
"""Standard deviation of a voltage that is constant for the motor, relative to its mean."""
_ORDER: Final = 4
"""Order of the differences in which a signal is nothing but its white noise."""
_WARMS: Final = 2.0
"""Range of a logged temperature that is more than the steps of a thermometer [K]."""
_RIDGE: Final = 1e-12
"""Regularisation per sample of `predicted`, whose regressors have a mean square of one."""


@dataclass(frozen=True)
class Signals:
    """Voltage, current and speed of a run, in SI units."""

    time: Array
    """(n_sample,) [s]."""
    voltage: Array
    """(n_sample,) [V]."""
    current: Array
    """(n_sample,) [A]."""
    speed: Array
    """(n_sample,) [rad/s]."""
    joined: Bool
    """(n_sample - 1,) False for an interval that crosses a gap of the record or touches a saturated
    sample."""
    warmth: Array
    """(n_sample,) what R and K may change with: temperature, or time where none is logged [-]."""

    @cached_property
    def balances(self) -> tuple[Balance, ...]:
        """The balances over each of `windows_of`."""
        v, i, w = self.voltage, self.current, self.speed
        i_noise, w_noise = (difference_noise([x], _ORDER) ** 2 for x in (i, w))
        found = []
        for windows in windows_of(self):
            count = float(np.median(np.diff(windows.edges)))
            rate = 2.0 / float(np.median(np.diff(windows.time[windows.edges]))) ** 2
            noise = i_noise / count, w_noise / count, i_noise * rate, w_noise * rate
            means = [windows.mean(x) for x in (v, i, w)]
            rates = windows.rate(i), windows.rate(w)
            warmth = windows.mean(self.warmth)
            found.append(Balance(means[0], means[1], means[2], rates[0], rates[1], warmth, noise))
        return tuple(found)


def signals_of(run: Run, samples: int = SAMPLES) -> Signals:
    """Signals of the first samples of a run, interpolated where a channel is held.

    Intervals at saturated samples are excluded.
    """
    joined = run.joined
    for name in ("current_A", "speed_rad_s"):
        if name in run.clipped:
            joined &= ~(run.clipped[name][1:] | run.clipped[name][:-1])
    warmth = run.time[:samples]
    if run.temperature is not None and np.ptp(run.temperature[:samples]) > _WARMS:
        warmth = run.temperature[:samples]
    return Signals(
        run.time[:samples],
        run.voltage[:samples],
        run.between_updates("current_A")[:samples],
        run.between_updates("speed_rad_s")[:samples],
        joined[: samples - 1],
        (warmth - warmth.mean()) / max(float(np.ptp(warmth)), 1e-300),
    )


def is_constant(voltage: Array) -> bool:
    """True if a voltage (n_sample,) is constant for the motor: it scatters by less than 1 %."""
    return bool(np.std(voltage) <= _CONSTANT * abs(np.mean(voltage)))


def has_signal(signal: Array) -> bool:
    """True if means over 16 samples of a signal (n_sample,) scatter more than white noise's."""
    count = signal.size // _NOISE_WINDOW
    if count < _FEWEST_WINDOWS // 3:
        return True
    means = signal[: count * _NOISE_WINDOW].reshape(count, _NOISE_WINDOW).mean(axis=1)
    white = 0.5 * mean_square(np.diff(signal)) / _NOISE_WINDOW
    return float(np.var(means)) > _NOISE_TIMES * white


@dataclass(frozen=True)
class Regression:
    """Linear regression with jackknife standard errors."""

    values: Array
    """(n_regressor,) coefficients."""
    errors: Array
    """(n_regressor,) their standard errors."""
    shares: Array
    """(n_regressor,) RMS of each term over that of the target, with the coefficient's sign [-]."""
    missed: float
    """Unexplained fraction of the target's variance [-]."""


def mean_square(signal: Array) -> float:
    """Mean square of a signal."""
    return float(np.mean(signal**2))


def regress(
    target: Array, regressors: Sequence[Array], noise: Sequence[float] = ()
) -> Regression | None:
    """Least squares of (n,) values on (n,) regressors and a constant; None if collinear.

    `noise` is the variance of the noise of the first regressors.
    """
    matrix = np.column_stack(regressors)
    matrix = matrix - matrix.mean(axis=0)
    target = target - target.mean()
    scale, size = np.sqrt(np.mean(matrix**2, axis=0)), float(np.sqrt(mean_square(target)))
    if size <= 0.0 or not np.all(scale > 0.0):
        return None
    unit = matrix / scale
    moments = unit.T @ unit
    if np.linalg.cond(moments) > 1e10:
        return None
    product = unit.T @ target
    values = np.linalg.solve(moments, product)
    estimates = []
    for block in np.array_split(np.arange(target.size), _BLOCKS):
        left = moments - unit[block].T @ unit[block]
        without = product - unit[block].T @ target[block]
        estimates.append(np.linalg.lstsq(left, without, rcond=1e-12)[0])
    spread = np.array(estimates)
    errors = np.sqrt((_BLOCKS - 1) * np.mean((spread - spread.mean(axis=0)) ** 2, axis=0))
    if noise:
        errors = np.hypot(errors, _bias(values, moments, noise / scale[: len(noise)] ** 2))
    missed = mean_square(target - unit @ values) / size**2
    return Regression(values / scale, errors / scale, values / size, missed)


def _bias(values: Array, moments: Array, noise: Array) -> Array:
    """Bias (n,) of least squares by the relative noise variances of the first regressors.

    Infinite if a combination of the regressors is nothing but noise.
    """
    rows = moments[0, 0]
    share = np.zeros_like(moments)
    share[:, : noise.size] = np.linalg.inv(moments)[:, : noise.size] * noise * rows
    if np.max(np.linalg.eigvals(share).real) >= 1.0:
        return np.full(values.size, np.inf)
    return np.asarray(np.linalg.solve(np.eye(values.size) - share, values) - values)


def predicted(
    columns: Sequence[Array], target: Array, used: Bool, least: float
) -> tuple[Array, Array]:
    """Regression of a target (n,) on columns (n,) over the used rows, and its deviation.

    The deviation (n,) is that of a prediction from the used rows, which may determine less than a
    prediction elsewhere needs; `least` is the least deviation of the regression.
    """
    matrix = np.column_stack(columns)
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    matrix /= np.where(scale > 0.0, scale, 1.0)
    moments = matrix[used].T @ matrix[used] + _RIDGE * target.size * np.eye(matrix.shape[1])
    values = matrix @ solution(moments, matrix[used].T @ target[used])
    deviation = max(float(np.sqrt(mean_square((target - values)[used]))), least)
    leverage = np.sum(matrix * solution(moments, matrix.T).T, axis=1)
    return np.asarray(values), deviation * np.sqrt(1.0 + leverage)


@dataclass(frozen=True)
class Balance:
    """Both balances over windows of one length."""

    voltage: Array
    """(n_window,) means [V]."""
    current: Array
    """(n_window,) means [A]."""
    speed: Array
    """(n_window,) means [rad/s]."""
    current_rate: Array
    """(n_window,) [A/s]."""
    speed_rate: Array
    """(n_window,) [rad/s^2]."""
    warmth: Array
    """(n_window,) means [-]."""
    noise: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    """Variance of the white noise of current, speed, current rate and speed rate."""

    @cached_property
    def electrical(self) -> Regression | None:
        """Coefficients R, K, L, and the brush drop if the current has both signs."""
        return self._electrical()

    @cached_property
    def heated(self) -> Regression | None:
        """The same with R and K linear in the warmth, for their mean values."""
        return self._electrical(self.warmth * self.current, self.warmth * self.speed)

    def _electrical(self, *others: Array) -> Regression | None:
        regressors = [self.current, self.speed, self.current_rate, *others]
        if reverses(self.current):
            regressors.append(_soft_sign(self.current))
        return regress(self.voltage, regressors, self.noise[:3])

    @cached_property
    def mechanical(self) -> Regression | None:
        """Coefficients J / K, b / K, and the dry friction if the motor reverses."""
        return self._mechanical()

    def _mechanical(self, *others: Array) -> Regression | None:
        regressors = [self.speed_rate, self.speed, *others]
        if reverses(self.speed):
            regressors.append(_soft_sign(self.speed))
        return regress(self.current, regressors, self.noise[3:0:-2])

    def proportion(self, missed: float, error: float) -> tuple[float, float, float] | None:
        """Voltage per current [ohm], per speed [V s/rad], and J / b [s] of proportional signals.

        They change linearly with the warmth.  None if the current leaves more than a fraction of
        the voltage unexplained, or the speed of the current, or if the relative standard error of
        one of the three is not below `error`.
        """
        heated = self.warmth * self.current
        e = regress(self.voltage, [self.current, self.current_rate, heated], self.noise[:3:2])
        m = self._mechanical(self.warmth * self.speed)
        if e is None or m is None or max(e.missed, m.missed) > missed:
            return None
        gain, inertia, friction = map(float, (e.values[0], *m.values[:2]))
        errors = e.errors[0] / gain, m.errors[0] / inertia, m.errors[1] / friction
        if not np.max(np.abs(errors)) < error:
            return None
        return gain, gain * friction, inertia / friction


@dataclass(frozen=True)
class Windows:
    """Windows of equal sample count, without those across a gap."""

    time: Array
    """(n_sample,) [s]."""
    edges: Index
    """(n_window + n_gap + 1,) samples at which windows begin and end."""
    kept: Bool
    """False for a window across a gap."""

    def mean(self, signal: Array) -> Array:
        """(n_window,) means of a signal (n_sample,)."""
        area = np.cumsum(0.5 * (signal[1:] + signal[:-1]) * np.diff(self.time))
        return self._per_second(np.concatenate(([0.0], area))[self.edges])

    def rate(self, signal: Array) -> Array:
        """(n_window,) mean time derivatives of a signal (n_sample,)."""
        return self._per_second(signal[self.edges])

    def _per_second(self, values: Array) -> Array:
        return np.asarray((np.diff(values) / np.diff(self.time[self.edges]))[self.kept])


def windows_of(signals: Signals) -> list[Windows]:
    """Short and long windows, if the run is long enough for them."""
    rows = signals.time.size
    lengths = sorted({_WINDOW_SAMPLES, max(_WINDOW_SAMPLES, rows // _WINDOWS)})
    found = [_windows(signals, length) for length in lengths if rows > _FEWEST_WINDOWS * length]
    return [windows for windows in found if np.count_nonzero(windows.kept) >= _FEWEST_WINDOWS]


def _windows(signals: Signals, length: int) -> Windows:
    edges = np.arange((signals.time.size - 1) // length + 1) * length
    return Windows(signals.time, edges, np.add.reduceat(~signals.joined, edges[:-1]) == 0)


def reverses(signal: Array) -> bool:
    """True if a signal has both signs, the weaker one by more than a tenth of the stronger."""
    high, low = float(np.max(signal)), float(np.min(signal))
    return min(high, -low) > 0.1 * max(high, -low)


def _soft_sign(signal: Array) -> Array:
    """Sign of a signal, linear up to a tenth of its peak."""
    return np.asarray(np.clip(signal / max(0.1 * float(np.abs(signal).max()), 1e-300), -1.0, 1.0))
