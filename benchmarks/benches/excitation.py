"""Excitation of the motor: voltage levels, triangles and a superimposed binary sequence.

The slew rate of the levels corresponds to a drive with a current limit of a few times the rated
current.  The binary sequence, a fraction of the voltage at stall with rated current, excites the
inductance.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.benches.motors import BenchMotor

__all__ = ["speeds", "voltages"]

Array = NDArray[np.float64]
Random = np.random.Generator

_OVERLOAD: Final = 2.5
"""Ratio of the current during acceleration to the rated current."""
_STILL: Final = 0.15
"""Share of the levels that are zero."""


def voltages(motor: BenchMotor, time: Array, number: int, one_way: bool, rng: Random) -> Array:
    """Voltage command at each sample [V].

    Args:
        motor: The motor.
        time: (n_sample,) [s].
        number: Number of the run; every third is a triangle.
        one_way: Whether the voltage keeps its sign.
        rng: Random generator.
    """
    full = motor.rated_voltage
    if number % 3 == 2:
        period = rng.uniform(60.0, 120.0) * motor.mechanical_time_constant
        phase = (time / period) % 1.0
        target = 0.6 * full * (4.0 * np.abs(phase - 0.5) - 1.0)
        target = 0.55 * full + 0.5 * target if one_way else target
    else:
        target = full * _levels(motor, time, one_way, rng)
    slope = _OVERLOAD * motor.rated_current * motor.Kt25**2 / motor.J
    slow = _limited(target, slope * np.diff(time, prepend=time[0]))
    size = rng.uniform(0.4, 0.9) * motor.rated_current * motor.Ra25
    size = min(size, 0.1 * full) if one_way else size
    return slow + size * _binary(time.size, rng)


def speeds(motor: BenchMotor, time: Array, rng: Random) -> Array:
    """Speed reference at each sample [rad/s].

    Args:
        motor: The motor.
        time: (n_sample,) [s].
        rng: Random generator.
    """
    target = motor.rated_speed * _levels(motor, time, False, rng)
    slope = _OVERLOAD * motor.rated_torque / motor.J
    return _limited(target, slope * np.diff(time, prepend=time[0]))


def _levels(motor: BenchMotor, time: Array, one_way: bool, rng: Random) -> Array:
    """Levels relative to the rated value that last 3 to 40 mechanical time constants."""
    out, end, level = np.zeros(time.size), -1.0, 0.0
    for k, now in enumerate(time):
        if now >= end:
            end = now + rng.uniform(3.0, 40.0) * motor.mechanical_time_constant
            level = rng.uniform(0.3, 0.85) if one_way else rng.uniform(-0.85, 0.85)
            level = 0.0 if not one_way and rng.random() < _STILL else level
        out[k] = level
    return out


def _limited(target: Array, most: Array) -> Array:
    """Limit the change of the target per sample to `most`."""
    out, value = np.empty_like(target), 0.0
    for k, wanted in enumerate(target):
        value += min(max(wanted - value, -most[k]), most[k])
        out[k] = value
    return out


def _binary(rows: int, rng: Random) -> Array:
    """Random sequence of -1 and 1 with constant values over two to eight samples."""
    lasting = rng.integers(2, 9, rows)
    return np.asarray(np.repeat(rng.choice([-1.0, 1.0], rows), lasting)[:rows])
