"""Right-hand side of the hidden plant (compiled), independent of the identification.

No code is shared with the identification, so an error in one of the two appears as a misfit instead
of cancelling.  Units are SI, temperatures degC.  The equations, with dry friction torque F and its
direction, which the integrator holds:

    L(i) di/dt = v - Ra(T_winding) i - Kt(T_magnet, i) w - losses
    J dw/dt    = Kt i - b(T) w - direction * F - loads - shaft
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from bench.coefficients import fall, resistance, torque_constant
from bench.torques import bristle_rate, drive_torque, dry_level, shaft_torque

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["derivative"]

_TWO_PI = 2.0 * np.pi


@njit(error_model="numpy")
def _brush_voltage(i: float, p: Any) -> float:
    """Brush voltage drop, with the sign of the current [V]."""
    x = i / p.brush_knee
    if p.brush_law < 0.5:
        shape = np.tanh(x)
    elif p.brush_law < 1.5:
        shape = np.sign(x) * (1.0 - np.exp(-abs(x)))
    else:
        shape = x / (1.0 + abs(x))
    return p.brush * shape * (1.0 + p.brush_uneven * np.sign(i))


@njit(error_model="numpy")
def _voltage_losses(t: float, y: NDArray[np.float64], p: Any, v: float) -> float:
    """Voltage losses in addition to Ra i and the back-EMF [V]."""
    i = y[0]
    lost = 0.0
    if p.brush != 0.0:
        lost += _brush_voltage(i, p)
    if p.square_loss != 0.0:
        lost += p.square_loss * np.sign(i) * abs(i / p.rated_current) ** p.square_loss_power
    if p.dead_zone != 0.0:
        if p.dead_zone_width > 0.0:
            lost += p.dead_zone * np.tanh(v / p.dead_zone_width)
        else:
            lost += max(-p.dead_zone, min(p.dead_zone, v))
    if p.commutation_loss != 0.0:
        turning = abs(y[1] / p.rated_speed) ** p.commutation_power
        lost += p.commutation_loss * i / p.rated_current * turning
    if p.hum != 0.0:
        lost += p.hum * np.sin(_TWO_PI * (p.hum_frequency + 0.5 * p.hum_drift * t) * t)
    return lost


@njit(error_model="numpy")
def _slow_states(y: NDArray[np.float64], dy: NDArray[np.float64], p: Any, logged: float) -> None:
    """Time derivatives of the temperatures [K/s]."""
    if p.winding_lag > 0.0:
        dy[3] = (logged - y[3]) / p.winding_lag
        dy[4] = (y[3] - y[4]) / p.winding_lag
    if p.heat_time > 0.0:
        load = resistance(y, p, logged) / p.Ra25 * (y[0] / p.rated_current) ** 2
        turning = p.heat_speed * (y[1] / p.rated_speed) ** 2
        dy[5] = (p.heat_rise * load + turning - y[5]) / p.heat_time
        if p.heat_time_2 > 0.0:
            dy[6] = (p.heat_rise_2 * load - y[6]) / p.heat_time_2
    if p.magnet_lag > 0.0:
        dy[7] = (logged - y[7]) / p.magnet_lag
        dy[8] = (y[7] - y[8]) / p.magnet_lag


@njit(error_model="numpy")
def _filter_states(y: NDArray[np.float64], dy: NDArray[np.float64], p: Any) -> None:
    """Time derivatives of the sensor filters: first-order or second-order Butterworth low-pass."""
    if p.current_filter > 0.0:
        if p.current_filter_order > 1.5:
            dy[13] = (y[0] - y[12]) / p.current_filter**2 - np.sqrt(2.0) * y[13] / p.current_filter
            dy[12] = y[13]
        else:
            dy[12] = (y[0] - y[12]) / p.current_filter
    if p.speed_filter > 0.0:
        if p.speed_filter_order > 1.5:
            dy[15] = (y[1] - y[14]) / p.speed_filter**2 - np.sqrt(2.0) * y[15] / p.speed_filter
            dy[14] = y[15]
        else:
            dy[14] = (y[1] - y[14]) / p.speed_filter


@njit(error_model="numpy")
def derivative(t: float, y: NDArray[np.float64], dy: NDArray[np.float64], p: Any, u: Any) -> None:
    """Write the time derivative of every state to `dy`.

    Args:
        t: Time since the start of the run [s].
        y: (n_state,) state, as in `bench.plant.STATES`.
        dy: (n_state,) time derivatives, overwritten.
        p: Plant record.
        u: Drive record: present voltage and temperature, mode of dry friction.
    """
    logged = u.temperature + u.temperature_slope * (t - u.start)
    v = u.voltage + u.voltage_slope * (t - u.start)
    i = y[0]
    constant = torque_constant(y, p, logged, u.peak)
    falling = fall(
        abs(i) / p.rated_current, p.inductance, p.inductance_power, p.inductance_exponential
    )
    inductance = p.L * (p.inductance_floor + (1.0 - p.inductance_floor) * falling)
    voltage = v - _voltage_losses(t, y, p, v)
    dy[0] = (voltage - resistance(y, p, logged) * i - constant * y[1]) / inductance
    if u.direction == 0.0:
        dy[1] = 0.0
    else:
        torque = drive_torque(t, y, p, u) - u.direction * dry_level(t, y, p, u, logged, u.direction)
        dy[1] = torque / (p.J - p.load_inertia)
    dy[2] = y[1]
    _slow_states(y, dy, p, logged)
    if p.load_inertia > 0.0:
        dy[9] = shaft_torque(y, p) / p.load_inertia
        dy[10] = y[1] - y[9]
    if p.bristle_level > 0.0:
        dy[11] = bristle_rate(y, p)
    _filter_states(y, dy, p)
