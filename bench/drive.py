"""Current-limited voltage drive (compiled), and the inputs of the plant up to the next knot."""

from __future__ import annotations

from typing import Any

from numba import njit

from bench.coefficients import magnet_temperature, resistance, torque_constant

__all__ = ["limited", "open_interval"]


@njit(error_model="numpy")
def limited(voltage: float, y: Any, p: Any, u: Any, limit: float) -> float:
    """Voltage command limited such that the steady current stays within the limit [V].

    The drive predicts the current from the voltage at the present speed.  The applied voltage is
    also limited to 1.2 times the rated voltage: without this supply limit, a drive that
    overestimates the back-EMF would diverge.
    """
    if limit <= 0.0:
        return voltage
    behind = torque_constant(y, p, u.temperature, u.peak) * y[1]
    room = resistance(y, p, u.temperature) * limit
    supply = 1.2 * p.rated_voltage
    return min(max(voltage, behind - room, -supply), behind + room, supply)


@njit(error_model="numpy")
def open_interval(
    n: int, times: Any, y: Any, p: Any, u: Any, command: Any, temperature: Any,
    is_linear: bool, limit: float, applied: Any,
) -> None:  # fmt: skip
    """Set the drive record for the interval that starts at knot `n`, and log its voltage.

    For ZOH, the state at the knot itself determines the voltage limit.  For FOH, it is the state at
    the preceding knot, because the slope must be known at the start of the interval.
    """
    u.start = times[n]
    u.temperature = temperature[n]
    u.peak = max(u.peak, magnet_temperature(y, p, u.temperature))
    if not is_linear:
        applied[n] = limited(command[n], y, p, u, limit)
    u.voltage = applied[n]
    u.voltage_slope = 0.0
    u.temperature_slope = 0.0
    if n + 1 == times.size:
        return
    length = times[n + 1] - times[n]
    u.temperature_slope = (temperature[n + 1] - temperature[n]) / length
    if is_linear:
        applied[n + 1] = limited(command[n + 1], y, p, u, limit)
        u.voltage_slope = (applied[n + 1] - applied[n]) / length
