"""Voltage that changes between samples which are too far apart to show its course.

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

from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.balance import Signals
from identification.checks.finding import Finding
from identification.ingest.run import Run
from identification.linear import least_squares

__all__ = ["aliased_findings"]

_POOR: Final = 0.09
"""Unexplained variance above which a simulation is poor: an NRMSE of 0.3, as in `fit.sensors`."""
_HALF: Final = 0.5
"""Rest over rest with one regressor less; with 40 pairs by chance once in ten million."""
_NOTHING: Final = 0.6
"""Unexplained variance above which a channel follows nothing, as in `checks.campaign`."""
_FEWEST: Final = 40


def aliased_findings(run: Run, signals: Signals) -> list[Finding]:
    """Finding for a voltage that changes between samples of a motor that settles between them."""
    pairs = np.flatnonzero(signals.joined)
    if pairs.size < _FEWEST:
        return []
    voltage, current, speed = signals.voltage, signals.current, signals.speed
    one, before, after = np.ones(pairs.size), voltage[pairs], voltage[pairs + 1]
    state = [current[pairs], speed[pairs], before, one]
    rise, swing = current[pairs + 1], speed[pairs + 1]
    if _regressed(swing, [after, *state])[1] < _HALF * _regressed(swing, [after, before, one])[1]:
        return []
    missed = {}
    for name, target, others in (
        ("current_A", rise, [*state, swing]),
        ("speed_rad_s", swing, state),
    ):
        variance = float(np.var(target))
        _, held = _regressed(target, others)
        gain, left = _regressed(target, [after, *others])
        if held > _POOR * variance and left < _HALF * held and gain > 0.0:
            return [
                _finding(
                    run,
                    f"{name} follows the voltage of the same sample",
                    name,
                    held / variance,
                    _POOR,
                )
            ]
        missed[name] = left / variance if variance > 0.0 else 0.0
    _, seen = _regressed(rise, [swing, *state])
    is_motion = seen < _HALF * _regressed(rise, state)[1]
    if missed["speed_rad_s"] > _NOTHING and (is_motion or missed["current_A"] > _NOTHING):
        return [
            _finding(
                run,
                "speed_rad_s does not follow it",
                "speed_rad_s",
                missed["speed_rad_s"],
                _NOTHING,
            )
        ]
    return []


def _finding(run: Run, sign: str, column: str, missed: float, limit: float) -> Finding:
    rate = run.sample_rate_hz
    remedy = (
        "record with several samples in the mechanical time constant and in the shortest time for "
        "which the voltage is constant, or change the voltage only when a sample is taken"
    )
    return Finding(
        "voltage_between_samples",
        "refuse",
        run.name,
        "voltage_V",
        f"it changes between the samples, {1e3 / rate:.3g} ms apart, and the motor settles within "
        f"that time: {sign}, so the log does not show which voltage acted, and no model can be "
        f"simulated from it; {remedy}",
        f"unexplained fraction of the variance of {column}",
        missed,
        limit,
        remedy=remedy,
    )


def _regressed(target: Array, columns: list[Array]) -> tuple[float, float]:
    """First coefficient and mean square residual of a regression."""
    matrix = np.column_stack(columns)
    scale = np.sqrt(np.mean(matrix**2, axis=0))
    scale = np.where(scale > 0.0, scale, 1.0)
    values = least_squares(matrix / scale, target, 1e-10)
    residual = target - matrix / scale @ values
    return float(values[0] / scale[0]), float(np.mean(residual**2))
