"""Sensor faults: dead, stuck at one value, copied from another channel, or noise only.

Two tests of noise hold for records of any length.  A channel of white noise has

    lag-1 autocorrelation r1 of variance 1/n
    F = (R^2 / p) / ((1 - R^2) / (n - p - 1)), distributed as F(p, n - p - 1)

where R^2 is the explained fraction of the channel, regressed on p signals that are independent of
it, of any autocorrelation.  A channel is called noise if neither is significant: a drive that
switches at random at each sample is white as well, but current and speed respond to it.

Source: Anderson, The Distribution of the Serial Correlation Coefficient, Annals of Mathematical
Statistics 13 (1942), 1-13; F test of the linear model with normal errors.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from scipy.special import fdtrc

from identification.arrays import Array, Bool
from identification.checks.balance import (
    CHANNELS,
    NO_VOLTAGE,
    Balance,
    Signals,
    is_constant,
    mean_square,
    regress,
)
from identification.checks.finding import Finding, Measured, refusal, signed, suspicion
from identification.ingest.run import Run

__all__ = [
    "NOISE_PROBABILITY",
    "copied_findings",
    "dead_findings",
    "noise_probability",
    "stuck_findings",
    "unlogged_voltage_findings",
]

_FOLLOWS: Final = 0.15
"""Explained fraction of a channel below which it is noise.  The least in 3,360 healthy balances was
0.6; noise alone reaches 0.1 with five regressors and 120 windows."""
_NEEDED: Final = 0.02
"""Fraction of the voltage that the dead channel would have to explain."""
_OTHER: Final = 0.12
"""Explained fraction of the other channel that proves that the motor responded."""
_FEWEST_SAMPLES: Final = 40
"""Samples from which noise is told from a response."""
_STAY: Final = 20
_STAYS: Final = 5.0
_STUCK: Final = 1.8
_STUCK_SHARE: Final = 0.25
_CONTINUES: Final = 0.5
"""Least rise of a speed after its first value, over that value: exp(-0.7) of a motor that shows it
at 0.7 of its time constant."""
NOISE_PROBABILITY: Final = 1e-3
"""Probability of a larger F below which a channel is no noise."""
_DEVIATIONS: Final = 3.0
"""Standard deviations of r1 above which a channel is no noise; one-sided probability 0.0013."""
_FEWEST: Final = 30
_SMOOTH: Final = 0.9
"""Autocorrelation above which less than a tenth of the variance of a speed is noise."""
_UNEXPLAINED: Final = 0.6
_LEVEL: Final = 10.0
"""Least mean of a constant voltage that may be a magnitude, in standard deviations."""


def copied_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Findings for channels with the samples of another one, sign ignored."""
    for first, second in itertools.combinations(CHANNELS, 2):
        one, other = getattr(signals, CHANNELS[first]), getattr(signals, CHANNELS[second])
        if np.ptp(one) > 0.0 and np.array_equal(np.abs(one), np.abs(other)):
            yield refusal(
                "copied_channel",
                run,
                second,
                f"has the same samples as {first}; export the correct signal",
                ("number of equal samples", float(one.size), 0.0),
            )


def dead_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Findings for current or speed sensors that do not respond to the drive."""
    balances = signals.balances
    if is_constant(signals.voltage):
        # Nothing to follow: a motor that runs steadily has no signal but noise.
        return
    if not balances:
        yield from _noise_findings(run, signals)
        return
    current = max(_explained(b, "current") for b in balances)
    speed = max(_explained(b, "speed") for b in balances)
    share = "explained fraction of the variance"
    if current < _FOLLOWS and speed > _OTHER and _needed(balances, "current") > _NEEDED:
        yield _dead(run, "current_A", "the voltage and the speed", (share, current, _FOLLOWS))
    if speed < _FOLLOWS and current > _OTHER and _needed(balances, "speed") > _NEEDED:
        yield _dead(run, "speed_rad_s", "the voltage and the current", (share, speed, _FOLLOWS))
    if current < _FOLLOWS and speed < _FOLLOWS:
        yield _dead(run, None, "the voltage", (share, max(current, speed), _FOLLOWS))


def _noise_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Findings of a run too short for the balances over windows."""
    if signals.time.size < _FEWEST_SAMPLES or _is_noise(signals, "voltage"):
        return
    for column in ("current_A", "speed_rad_s"):
        if _is_noise(signals, CHANNELS[column]):
            probability = noise_probability(signals, CHANNELS[column])
            measured = "probability of noise that is explained as well", probability
            others = "the voltage and the other channel"
            yield _dead(run, column, others, (*measured, NOISE_PROBABILITY))


def _dead(run: Run, column: str | None, others: str, measured: Measured) -> Finding:
    subject = "" if column else "current_A and speed_rad_s: "
    return refusal(
        "dead_sensor",
        run,
        column,
        f"{subject}no response to {others}; probably a sensor is not connected or the motor was "
        "not driven; omit the run, or repeat the measurement",
        measured,
    )


def _explained(balance: Balance, channel: str) -> float:
    """Explained fraction of a channel, regressed on voltage, the other channel and its rate."""
    b = balance
    target, other, rate = (
        (b.current, b.speed, b.speed_rate)
        if channel == "current"
        else (b.speed, b.current, b.current_rate)
    )
    if np.ptp(target) == 0.0:
        return 0.0
    regressors = [x for x in (b.voltage, other, rate) if np.ptp(x) > 0.0]
    if channel == "speed" and np.ptp(b.voltage) > 0.0:
        # The speed responds slowly, so that past voltage counts as well as present voltage: a
        # low-pass filter with a time constant of eight windows.
        kernel = np.exp(-np.arange(32) / 8.0)
        past = np.convolve(b.voltage - b.voltage[0], kernel / kernel.sum())
        regressors.append(past[: b.voltage.size])
    fit = regress(target, regressors) or regress(target, regressors[:1])
    return 1.0 if fit is None else 1.0 - fit.missed


def _needed(balances: Sequence[Balance], channel: str) -> float:
    """Fraction of the voltage that the other channel leaves unexplained."""
    left = []
    for b in balances:
        regressors = [b.speed] if channel == "current" else [b.current, b.current_rate]
        fit = regress(b.voltage, regressors)
        left.append(1.0 if fit is None else fit.missed)
    return min(left)


def stuck_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Findings for sensors that hold one value while the motor continues to move."""
    for column in ("current_A", "speed_rad_s"):
        signal = getattr(signals, CHANNELS[column])
        start, stop, usual = _longest_stay(signal)
        if stop - start < max(_STAY, _STAYS * usual) or stop - start == signals.time.size:
            continue
        # Samples at rest before the motor is driven, and those that the fit omits, are no evidence.
        first = _first_driven(signals.voltage, start, stop)
        driven = int(np.count_nonzero(signals.joined[first : max(stop - 1, first)])) + 1
        if driven < max(_STAY, _STAYS * usual):
            continue
        if column == "speed_rad_s" and _starts_from_rest(signal, start, stop, driven):
            continue
        ratio, share = _inside(signals, start, stop)
        if ratio > _STUCK and share > _STUCK_SHARE:
            yield refusal(
                "stuck_sensor",
                run,
                column,
                f"is constant at {signal[start] + 0.0:.6g} for {stop - start} samples from "
                f"{signals.time[start]:.6g} s while the other channels change; "
                + _advice(column, signal, float(signal[start])),
                ("RMS error of the voltage balance relative to the other samples", ratio, _STUCK),
            )


def _advice(column: str, signal: Array, value: float) -> str:
    """Remedy for a sensor that stays at a value."""
    if column == "current_A" and value == 0.0 and np.min(signal) * np.max(signal) == 0.0:
        return (
            "the sensor seems to measure one direction only, and reads zero while the motor "
            "brakes: use one for both directions, or cut the file there"
        )
    return "cut the file there"


def _first_driven(voltage: Array, start: int, stop: int) -> int:
    """First sample of a span at which the motor has a voltage; `stop` if there is none."""
    size = np.abs(voltage)
    driven = np.flatnonzero(size[start:stop] > NO_VOLTAGE * size.max())
    return start + int(driven[0]) if driven.size else stop


def _starts_from_rest(speed: Array, start: int, stop: int, driven: int) -> bool:
    """True if a speed of zero ends as standstill does, `driven` samples after the first voltage.

    Inertia lets the speed of a shaft grow from zero, by about as much in the time after its first
    value as in that before; a sensor that responds again shows the speed of a shaft that has
    settled.
    """
    if start > 0 or speed[start] != 0.0 or stop == speed.size:
        return False
    sign = np.sign(speed[stop])
    rise = float(np.max(sign * speed[stop : stop + driven + 1])) - abs(float(speed[stop]))
    return rise > _CONTINUES * abs(float(speed[stop]))


def _longest_stay(signal: Array) -> tuple[int, int, int]:
    """Start and end (exclusive) of the longest constant stretch; median length of the next ten."""
    edges = np.concatenate(([0], np.flatnonzero(np.diff(signal) != 0.0) + 1, [signal.size]))
    lengths = np.diff(edges)
    order = np.argsort(lengths)
    longest = int(order[-1])
    # A saturated sensor, or a motor at standstill, has many constant stretches.
    usual = int(np.median(lengths[order[-11:-1]])) if lengths.size > 1 else 0
    return int(edges[longest]), int(edges[longest + 1]), usual


def _inside(signals: Signals, start: int, stop: int) -> tuple[float, float]:
    """RMS error of the voltage balance in a span, over that elsewhere and over the voltage.

    Both are the least of the balances with and without an offset: from a constant voltage an
    offset is not identifiable, and it would contradict the standstill before a single step.
    """
    used = np.append(signals.joined, False) | np.append(False, signals.joined)
    inside = used.copy()
    inside[:start] = inside[stop:] = False
    rate = np.gradient(signals.current, signals.time)
    physical = np.column_stack([signals.current, signals.speed, rate])
    matrices = (physical, np.column_stack([physical, np.ones(signals.time.size)]))
    outside = used & ~inside
    if np.count_nonzero(outside) < 10 * matrices[-1].shape[1]:
        return 0.0, 0.0
    return min(_inside_of(matrix, signals.voltage, inside, outside) for matrix in matrices)


def _inside_of(matrix: Array, voltage: Array, inside: Bool, outside: Bool) -> tuple[float, float]:
    """RMS error inside of a balance fitted outside, over that outside and over the voltage."""
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    matrix = matrix / np.where(scale > 0.0, scale, 1.0)
    values = np.linalg.lstsq(matrix[outside], voltage[outside], rcond=1e-10)[0]
    left = voltage - matrix @ values
    error = float(np.sqrt(np.mean(left[inside] ** 2)))
    usual = float(np.sqrt(np.mean(left[outside] ** 2)))
    size = float(np.std(voltage)) or 1.0
    return error / max(usual, 1e-12 * size), error / size


def _is_noise(signals: Signals, channel: str) -> bool:
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


def unlogged_voltage_findings(run: Run, signals: Signals) -> Iterator[Finding]:
    """Suspicion that a voltage was not logged: the motor does not run at the constant voltage.

    At a constant voltage v, current and speed obey K w = v - R i - L di/dt.
    """
    speed = signals.speed
    if speed.size < _FEWEST or _autocorrelation(speed) < _SMOOTH:
        return
    level, scatter = float(np.mean(signals.voltage)), float(np.std(signals.voltage))
    is_flat = _is_noise(signals, "voltage") or is_constant(signals.voltage)
    if np.std(speed) < 0.1 * float(np.max(np.abs(speed))) or not is_flat:
        return
    missed, _ = _missed(speed, [signals.current, np.gradient(signals.current, signals.time)])
    if missed >= _UNEXPLAINED:
        statistic = "fraction of the speed variance that a constant voltage leaves unexplained"
        remedy = "log the voltage at the motor terminals"
        # The magnitude of a voltage that switches between two signs is constant.
        is_level = abs(level) > _LEVEL * scatter
        if is_level:
            remedy += (
                ", or map a magnitude times a column of the direction, voltage_V=HEADER * DIRECTION"
            )
        yield suspicion(
            "unlogged_voltage",
            run,
            "voltage_V",
            f"is constant ({level:.4g} V, standard deviation {scatter:.2g} V) while the "
            "speed changes, and the current does not fit a constant voltage; check that the "
            "voltage at the motor terminals was logged",
            (statistic, missed, _UNEXPLAINED),
            *(signed(run, "voltage_V") if is_level else ()),
            remedy=remedy,
        )


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
