"""The drive, compiled: what voltage it gives, and what acts on the plant until the next sample."""

from __future__ import annotations

from typing import Any

from numba import njit

from bench.coefficients import magnet_temperature, resistance, torque_constant

__all__ = ["limited", "open_interval"]


@njit(error_model="numpy")
def limited(voltage: float, y: Any, p: Any, u: Any, limit: float) -> float:
    """Voltage that the drive applies so that the current settles within its limit [V].

    It foresees the current that a voltage would lead to at the present speed, and cannot give more
    than its supply has: without that bound a drive that overrates the back-EMF would run away.
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
    """Set the drive record for the interval that begins at knot `n`, and log its voltage.

    A held voltage is limited by the state at its own knot, a linear one by the state at the knot
    before, since the drive has to know where it is going when it sets out.
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
