"""Detection of samples that do not show one instant: a shifted channel, or too slow a sampling.

Two loggers with separate clocks shift a channel in time.  The voltage balance is evaluated on short
means with one channel taken earlier or later.  A shift is reported if the balance leaves much of
the voltage unexplained as logged and little at another lag.  A delay of a few samples, as in the
effect `channel_delay`, stays far below that.

A drive that holds the voltage from sample k to sample k + 1 makes the state of a motor at k + 1 a
function of the state and the voltage at k: the voltage logged at k + 1 cannot have acted yet.  If
the motor settles within a sample interval and the samples at k + 1 already follow the voltage
logged with them, the voltage has changed between the samples, at an unknown instant and perhaps
repeatedly (aliasing).  A simulation from the log then explains nothing or the wrong motor, with a
residual as white as sensor noise.

In least squares over the pairs of neighbouring samples, the motor settles if the state at k
explains less than half of what the voltages at k and k + 1 leave of the speed at k + 1.  The log is
then refused in two cases.

- *Follows at once.* The state and the voltage at k leave more than 9 % of the variance of current
  or speed, and the voltage at k + 1, with a positive coefficient, explains half of this rest.
- *Follows nothing.* The voltages at k and k + 1 leave more than 60 % of the variance of the speed,
  which is no noise of the sensor: it explains half of the rest of the current, or the current
  follows nothing either.

A controller that feeds the noise of a sensor back gives a negative coefficient.  If the motor does
not settle within an interval, the course of its signals shows when the voltage changed, and the
effects `input_hold` and `channel_delay` describe it.

Source: Ljung, System Identification, 2nd edition (1999), sections 13.3 (intersample behaviour) and
13.7 (choice of the sampling interval).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import CHANNELS, Signals, is_constant, mean_square
from identification.checks.finding import Finding, refusal
from identification.ingest.run import Run
from identification.linear import least_squares

__all__ = ["aliased_findings", "shifted_findings"]

_MISSED: Final = 0.1
_LEFT: Final = 0.3
_WINDOWS: Final = 1500
_SHORTEST_WINDOW: Final = 8
_FEWEST_WINDOWS: Final = 100
_LEAST: Final = 2
_SPAN: Final = 0.35
_RATE: Final = "rate"

_POOR: Final = 0.09
"""Unexplained variance above which a simulation is poor: an NRMSE of 0.3, as in `fit.sensors`."""
_HALF: Final = 0.5
"""Rest over rest with one regressor less; with 40 pairs by chance once in ten million."""
_NOTHING: Final = 0.6
"""Unexplained variance above which a channel follows nothing, as in `checks.campaign`."""
_FEWEST: Final = 40


def shifted_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Finding for a channel that is shifted in time against the others."""
    length = max(_SHORTEST_WINDOW, signals.time.size // _WINDOWS)
    count = (signals.time.size - 1) // length
    if count < _FEWEST_WINDOWS or not signals.joined.all():
        return
    fits = [b.electrical for b in signals.balances]
    before = min((fit.missed for fit in fits if fit is not None), default=0.0)
    if before < _MISSED:
        return
    means = {name: _means(getattr(signals, word), length) for name, word in CHANNELS.items()}
    means[_RATE] = np.diff(signals.current[: count * length + 1 : length])
    far = int(_SPAN * count)
    missed, name, shift = min(
        (_balance_missed(means, name, shift), name, shift)
        for name in CHANNELS
        for shift in range(-far, far + 1)
    )
    if missed > _LEFT * before or abs(shift) < _LEAST:
        return
    interval = float(np.median(np.diff(signals.time)))
    samples = abs(shift) * length
    sense, advice = ("lags", "earlier") if shift > 0 else ("leads", "later")
    yield refusal(
        "shifted_channel",
        run,
        name,
        f"{sense} the other channels by about {samples} samples ({samples * interval:.3g} s); "
        f"log all channels with one clock, or shift the column to {advice} times",
        ("unexplained fraction of the voltage variance", before, missed / _LEFT),
    )


def _means(signal: Array, length: int) -> Array:
    """Window means by the trapezoidal rule."""
    count = (signal.size - 1) // length
    middles = 0.5 * (signal[1:] + signal[:-1])
    return np.asarray(middles[: count * length].reshape(count, length).mean(axis=1))


def _balance_missed(means: dict[str, Array], name: str, shift: int) -> float:
    """Unexplained fraction of the voltage with one channel taken `shift` windows later."""
    count = means[name].size
    moved = (name, _RATE) if name == "current_A" else (name,)
    late = slice(max(shift, 0), count + min(shift, 0))
    early = slice(max(-shift, 0), count + min(-shift, 0))
    channels = {other: x[late] if other in moved else x[early] for other, x in means.items()}
    voltage, current, speed = (channels[n] for n in CHANNELS)
    size = float(np.var(voltage))
    if size == 0.0:
        return 1.0
    values, missed = _regressed(voltage, [current, speed, channels[_RATE], np.ones(current.size)])
    return missed / size if values[0] > 0.0 and values[1] > 0.0 else 1.0


def aliased_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Finding for a voltage that changes between samples of a motor that settles between them."""
    pairs = np.flatnonzero(signals.joined)
    if pairs.size < _FEWEST:
        return
    voltage, current, speed = signals.voltage, signals.current, signals.speed
    if is_constant(voltage):
        # The noise of a motor that runs steadily follows nothing.
        return
    one, before, after = np.ones(pairs.size), voltage[pairs], voltage[pairs + 1]
    state = [current[pairs], speed[pairs], before, one]
    rise, swing = current[pairs + 1], speed[pairs + 1]
    if _regressed(swing, [after, *state])[1] < _HALF * _regressed(swing, [after, before, one])[1]:
        return
    missed = {}
    for name, target, others in (
        ("current_A", rise, [*state, swing]),
        ("speed_rad_s", swing, state),
    ):
        variance = float(np.var(target))
        _, held = _regressed(target, others)
        values, left = _regressed(target, [after, *others])
        if held > _POOR * variance and left < _HALF * held and values[0] > 0.0:
            sign = f"{name} follows the voltage of the same sample"
            yield _finding(run, sign, name, held / variance, _POOR)
            return
        missed[name] = left / variance if variance > 0.0 else 0.0
    _, seen = _regressed(rise, [swing, *state])
    is_motion = seen < _HALF * _regressed(rise, state)[1]
    lost = missed["speed_rad_s"]
    if lost > _NOTHING and (is_motion or missed["current_A"] > _NOTHING):
        yield _finding(run, "speed_rad_s does not follow it", "speed_rad_s", lost, _NOTHING)


def _finding(run: Run, sign: str, column: str, missed: float, limit: float) -> Finding:
    rate = run.sample_rate_hz
    remedy = (
        "record with several samples in the mechanical time constant and in the shortest time for "
        "which the voltage is constant, or change the voltage only when a sample is taken"
    )
    return refusal(
        "voltage_between_samples",
        run,
        "voltage_V",
        f"it changes between the samples, {1e3 / rate:.3g} ms apart, and the motor settles within "
        f"that time: {sign}, so the log does not show which voltage acted, and no model can be "
        f"simulated from it; {remedy}",
        (f"unexplained fraction of the variance of {column}", missed, limit),
        remedy=remedy,
    )


def _regressed(target: Array, columns: list[Array]) -> tuple[Array, float]:
    """Coefficients of a regression on columns (n,) of one size, and its mean square residual."""
    matrix = np.column_stack(columns)
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    matrix /= np.where(scale > 0.0, scale, 1.0)
    values = least_squares(matrix, target, 1e-10)
    return values, mean_square(target - matrix @ values)
