"""Torques of the hidden plant (compiled): friction, loads, cogging, shaft, bristles.

Dry friction is separate from the other torques because it is set-valued: its direction is a mode
that the integrator switches at events, so no smoothing width is needed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit

from bench.coefficients import torque_constant

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["bristle_rate", "drive_torque", "dry_level", "shaft_torque"]

_TWO_PI = 2.0 * np.pi


@njit(error_model="numpy")
def dry_level(
    t: float, y: NDArray[np.float64], p: Any, u: Any, logged: float, direction: float
) -> float:
    """Breakaway torque of dry friction at standstill, else its sliding torque [N m]."""
    level = p.coulomb_forward if direction > 0.0 else p.coulomb_backward
    speed = abs(y[1])
    if p.stribeck != 0.0:
        ratio = (speed / p.stribeck_speed) ** p.stribeck_power
        if p.stribeck_lorentzian > 0.5:
            level += p.stribeck / (1.0 + ratio)
        else:
            level += p.stribeck * np.exp(-ratio)
    if p.load_friction != 0.0:
        torque = abs(torque_constant(y, p, logged, u.peak) * y[0])
        level += (
            p.load_friction * p.rated_torque * (torque / p.rated_torque) ** (p.load_friction_power)
        )
    if p.run_in_dry != 0.0:
        level += p.run_in_dry * np.exp(-(t + p.elapsed_before) / p.run_in_time)
    if p.hot_friction != 0.0:
        level += p.hot_friction * (max(logged, 0.0) / 100.0) ** p.hot_friction_power
    if p.angle_rub != 0.0:
        off = np.sin(0.5 * (y[2] - p.angle_rub_at))
        level += p.angle_rub * np.exp(-((off / p.angle_rub_width) ** 2))
    return level


@njit(error_model="numpy")
def _smooth_friction(t: float, y: NDArray[np.float64], p: Any, logged: float) -> float:
    """Friction torque that is a single-valued function of speed [N m]."""
    w = y[1]
    rise = logged - 25.0
    factor = 1.0
    if p.viscous_linear != 0.0:
        factor += p.viscous_linear * rise
    if p.viscous_exponential != 0.0:
        factor *= np.exp(p.viscous_exponential * rise)
    torque = p.b * factor * w
    if p.coulomb_smooth != 0.0:
        torque += p.coulomb_smooth * np.tanh(w / p.coulomb_width)
    if p.drag != 0.0:
        torque += p.drag * np.sign(w) * abs(w / p.rated_speed) ** p.drag_power
    if p.rub != 0.0 and abs(w) > p.rub_speed:
        over = (abs(w) - p.rub_speed) / (p.rated_speed - p.rub_speed)
        torque += p.rub * np.sign(w) * over**p.rub_power
    if p.run_in_viscous != 0.0:
        fading = np.exp(-(t + p.elapsed_before) / p.run_in_time)
        torque += p.run_in_viscous * fading * w / p.rated_speed
    return torque


@njit(error_model="numpy")
def _edge(t: float, at: float, width: float) -> float:
    """Rise from 0 to 1 at `at`, as a step or linear over `width`."""
    if width <= 0.0:
        return 1.0 if t >= at else 0.0
    return min(1.0, max(0.0, (t - at) / width))


@njit(error_model="numpy")
def _external_torque(t: float, y: NDArray[np.float64], p: Any) -> float:
    """Torque of load, cogging and ripple, positive against forward rotation [N m]."""
    torque = p.load
    if p.load_wander != 0.0:
        torque *= 1.0 + p.load_wander * np.sin(_TWO_PI * t / p.load_period)
    if p.step_torque != 0.0:
        inside = _edge(t, p.step_start, p.step_edge) - _edge(t, p.step_stop, p.step_edge)
        torque += p.step_torque * inside
    if p.cogging_1 != 0.0:
        torque += p.cogging_1 * np.sin(p.cogging_order_1 * y[2] + p.cogging_phase_1)
        torque += p.cogging_2 * np.sin(p.cogging_order_2 * y[2] + p.cogging_phase_2)
        torque += p.cogging_3 * np.sin(p.cogging_order_3 * y[2] + p.cogging_phase_3)
    if p.ripple != 0.0:
        wave = np.sin(_TWO_PI * p.ripple_frequency * t)
        if p.ripple_square > 0.5:
            wave = np.tanh(5.0 * wave)
        torque += p.ripple * wave
        if p.ripple_frequency_2 > 0.0:
            torque += 0.5 * p.ripple * np.sin(_TWO_PI * p.ripple_frequency_2 * t + 1.0)
    return torque


@njit(error_model="numpy")
def shaft_torque(y: NDArray[np.float64], p: Any) -> float:
    """Torque of the shaft on the load; it acts on the motor with opposite sign [N m]."""
    twist = y[10]
    damping = p.shaft_damping
    if p.shaft_backlash > 0.0:
        half = 0.5 * p.shaft_backlash
        if abs(twist) < half:
            return 0.0
        twist -= half * np.sign(twist)
    return twist * (p.shaft_stiffness + p.shaft_cubic * twist * twist) + damping * (y[1] - y[9])


@njit(error_model="numpy")
def bristle_rate(y: NDArray[np.float64], p: Any) -> float:
    """Deflection rate of the LuGre bristles [rad/s]; they slide at the torque `bristle_level`."""
    w = y[1]
    stiffness = p.bristle_level / p.bristle_deflection
    slow = np.exp(-((w / (0.03 * p.rated_speed)) ** 2))
    level = p.bristle_level * (1.0 + p.bristle_static * slow)
    return w - stiffness * abs(w) / level * y[11]


@njit(error_model="numpy")
def drive_torque(t: float, y: NDArray[np.float64], p: Any, u: Any) -> float:
    """Sum of all torques on the inertia of the motor except dry friction [N m]."""
    logged = u.temperature + u.temperature_slope * (t - u.start)
    torque = torque_constant(y, p, logged, u.peak) * y[0]
    torque -= _smooth_friction(t, y, p, logged) + _external_torque(t, y, p)
    if p.load_inertia > 0.0:
        torque -= shaft_torque(y, p)
    if p.bristle_level > 0.0:
        stiffness = p.bristle_level / p.bristle_deflection
        torque -= stiffness * y[11] + p.bristle_damping * bristle_rate(y, p)
    return torque
