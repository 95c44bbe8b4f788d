"""Sensor faults: dead, stuck at one value, or copied from another channel."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import (
    Balance,
    Signals,
    balances_of,
    regress,
)
from identification.checks.finding import Finding
from identification.checks.noise import NOISE_PROBABILITY, is_noise, noise_probability
from identification.ingest.run import Run

__all__ = ["copied_findings", "dead_findings", "stuck_findings"]

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

_NAMES: Final = {"voltage_V": "voltage", "current_A": "current", "speed_rad_s": "speed"}


def copied_findings(run: Run, signals: Signals) -> list[Finding]:
    """Findings for channels with the samples of another one, sign ignored."""
    found = []
    names = list(_NAMES)
    for at, first in enumerate(names):
        for second in names[at + 1 :]:
            one, other = getattr(signals, _NAMES[first]), getattr(signals, _NAMES[second])
            if np.ptp(one) > 0.0 and np.array_equal(np.abs(one), np.abs(other)):
                found.append(
                    Finding(
                        "copied_channel",
                        "refuse",
                        run.name,
                        second,
                        f"has the same samples as {first}; export the correct signal",
                        "number of equal samples",
                        float(one.size),
                        0.0,
                    )
                )
    return found


def dead_findings(run: Run, signals: Signals) -> list[Finding]:
    """Findings for current or speed sensors that do not respond to the drive."""
    balances = balances_of(signals)
    if np.ptp(signals.voltage) == 0.0:
        return []
    if not balances:
        return _noise_findings(run, signals)
    current = max(_explained(b, "current") for b in balances)
    speed = max(_explained(b, "speed") for b in balances)
    found = []
    if current < _FOLLOWS and speed > _OTHER and _needed(balances, "current") > _NEEDED:
        found.append(_dead(run, "current_A", "the voltage and the speed", current))
    if speed < _FOLLOWS and current > _OTHER and _needed(balances, "speed") > _NEEDED:
        found.append(_dead(run, "speed_rad_s", "the voltage and the current", speed))
    if current < _FOLLOWS and speed < _FOLLOWS:
        found.append(_dead(run, None, "the voltage", max(current, speed)))
    return found


def _noise_findings(run: Run, signals: Signals) -> list[Finding]:
    """Findings of a run too short for the balances over windows."""
    if signals.time.size < _FEWEST_SAMPLES or is_noise(signals, "voltage"):
        return []
    noisy = [name for name in ("current", "speed") if is_noise(signals, name)]
    columns = {"current": "current_A", "speed": "speed_rad_s"}
    return [
        replace(
            _dead(run, columns[name], "the voltage and the other channel", 0.0),
            statistic="probability of noise that is explained as well",
            value=noise_probability(signals, name),
            limit=NOISE_PROBABILITY,
        )
        for name in noisy
    ]


def _dead(run: Run, column: str | None, others: str, explained: float) -> Finding:
    subject = "" if column else "current_A and speed_rad_s: "
    return Finding(
        "dead_sensor",
        "refuse",
        run.name,
        column,
        f"{subject}no response to {others}; probably a sensor is not connected or the motor was "
        "not driven; omit the run, or repeat the measurement",
        "explained fraction of the variance",
        explained,
        _FOLLOWS,
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
        # The speed responds slowly, so that past voltage counts as well as present voltage.
        regressors.append(_filtered(b.voltage))
    fit = regress(target, regressors) or regress(target, regressors[:1])
    return 1.0 if fit is None else 1.0 - fit.missed


def _filtered(signal: Array) -> Array:
    """The signal through a low-pass filter with a time constant of eight windows."""
    kernel = np.exp(-np.arange(32) / 8.0)
    return np.convolve(signal - signal[0], kernel / kernel.sum())[: signal.size]


def _needed(balances: list[Balance], channel: str) -> float:
    """Fraction of the voltage that the other channel leaves unexplained."""
    left = []
    for b in balances:
        regressors = [b.speed] if channel == "current" else [b.current, b.current_rate]
        fit = regress(b.voltage, regressors)
        left.append(1.0 if fit is None else fit.missed)
    return min(left)


def stuck_findings(run: Run, signals: Signals) -> list[Finding]:
    """Findings for sensors that hold one value while the motor continues to move."""
    found = []
    for column in ("current_A", "speed_rad_s"):
        start, stop, usual = _longest_stay(getattr(signals, _NAMES[column]))
        if stop - start < max(_STAY, _STAYS * usual) or stop - start == signals.time.size:
            continue
        ratio, share = _inside(signals, start, stop)
        if ratio > _STUCK and share > _STUCK_SHARE:
            value = getattr(signals, _NAMES[column])[start]
            found.append(
                Finding(
                    "stuck_sensor",
                    "refuse",
                    run.name,
                    column,
                    f"is constant at {value:.6g} for {stop - start} samples from "
                    f"{signals.time[start]:.6g} s while the other channels change; cut the file "
                    "there",
                    "RMS error of the voltage balance relative to the other samples",
                    ratio,
                    _STUCK,
                )
            )
    return found


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
    """RMS error of the voltage balance in a span, over that elsewhere and over the voltage."""
    rate = np.gradient(signals.current, signals.time)
    matrix = np.column_stack([signals.current, signals.speed, rate, np.ones(signals.time.size)])
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    matrix = matrix / np.where(scale > 0.0, scale, 1.0)
    inside = np.zeros(signals.time.size, dtype=bool)
    inside[start:stop] = True
    if np.count_nonzero(~inside) < 10 * matrix.shape[1]:
        return 0.0, 0.0
    values = np.linalg.lstsq(matrix[~inside], signals.voltage[~inside], rcond=1e-10)[0]
    left = signals.voltage - matrix @ values
    error = float(np.sqrt(np.mean(left[inside] ** 2)))
    usual = float(np.sqrt(np.mean(left[~inside] ** 2)))
    size = float(np.std(signals.voltage)) or 1.0
    return error / max(usual, 1e-12 * size), error / size
