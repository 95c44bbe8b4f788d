"""Hidden plant as one flat NumPy record for compiled code.

Fields have names instead of indices: effects write them by name, the equations read them by name,
and an unknown field raises an error at once.  All fields of a motor without effects are zero except
those that `clean_plant` sets; a zero switches an effect off.
"""

from __future__ import annotations

import numpy as np

from bench.motors import Motor

__all__ = ["DRIVE", "PLANT", "STATES", "Plant", "clean_plant", "new_drive"]

Plant = np.void

STATES = (
    "current",
    "speed",
    "angle",
    "winding_lag_1",
    "winding_lag_2",
    "heat_1",
    "heat_2",
    "magnet_lag_1",
    "magnet_lag_2",
    "load_speed",
    "twist",
    "bristle",
    "current_filter_1",
    "current_filter_2",
    "speed_filter_1",
    "speed_filter_2",
)
"""State vector, in order; the integrator omits the states that a plant does not need."""

_DECLARED = ("Ra25", "alpha_Ra", "Kt25", "alpha_Kt", "J", "b", "L")
_RATED = ("rated_current", "rated_speed", "rated_voltage", "rated_torque")
_FRICTION = (
    "coulomb_forward",  # set-valued, forward rotation [N m]
    "coulomb_backward",
    "coulomb_smooth",  # [N m], times tanh of speed over coulomb_width [rad/s]
    "coulomb_width",
    "stribeck",  # [N m] in addition to Coulomb, decays over stribeck_speed [rad/s]
    "stribeck_speed",
    "stribeck_power",
    "stribeck_lorentzian",
    "drag",  # [N m] at rated speed
    "drag_power",
    "viscous_linear",  # [1/K]
    "viscous_exponential",  # [1/K]
)
_LOAD = (
    "load",
    "load_wander",  # relative amplitude of the load variation [-]
    "load_period",
    "step_torque",
    "step_start",
    "step_stop",
    "step_edge",
    "cogging_1",
    "cogging_2",
    "cogging_3",
    "cogging_order_1",
    "cogging_order_2",
    "cogging_order_3",
    "cogging_phase_1",
    "cogging_phase_2",
    "cogging_phase_3",
    "load_inertia",  # part of J on the load side of the shaft [kg m^2]
    "shaft_stiffness",
    "shaft_damping",
    "shaft_cubic",
    "shaft_backlash",  # total gap [rad]
)
_ELECTRICAL = (
    "brush",  # [V]
    "brush_knee",  # [A]
    "brush_law",  # 0 tanh, 1 exponential, 2 rational
    "brush_uneven",
    "flux",  # k of 1/(1 + k |i/rated|^n) or exp(-k |i/rated|^n)
    "flux_power",
    "flux_exponential",
    "inductance",
    "inductance_power",
    "inductance_exponential",
    "inductance_floor",  # fraction of L from leakage, which does not saturate [-]
)
_THERMAL = (
    "heat_rise",  # steady-state rise of the winding at rated copper loss [K]
    "heat_time",
    "heat_rise_2",
    "heat_time_2",
    "heat_speed",  # steady-state rise at rated speed from friction and iron loss [K]
    "winding_lag",
    "winding_lag_order",
    "magnet_lag",
    "magnet_lag_order",
    "curvature",  # [1/K^2]
    "curvature_cubic",  # [1/K^3]
    "demagnetization",
    "demagnetization_from",
    "demagnetization_to",
)
_SENSOR = (
    "current_filter",
    "current_filter_order",
    "speed_filter",
    "speed_filter_order",
)
_UNLISTED = (
    "rub",
    "rub_speed",
    "rub_power",
    "ripple",
    "ripple_frequency",
    "ripple_frequency_2",
    "ripple_square",
    "load_friction",
    "load_friction_power",
    "bristle_level",
    "bristle_deflection",
    "bristle_damping",
    "bristle_static",
    "run_in_viscous",
    "run_in_dry",
    "run_in_time",
    "elapsed_before",
    "square_loss",
    "square_loss_power",
    "dead_zone",
    "dead_zone_width",
    "commutation_loss",
    "commutation_power",
    "hum",
    "hum_frequency",
    "hum_drift",  # [Hz/s]
    "hot_friction",
    "hot_friction_power",
    "angle_rub",
    "angle_rub_width",
    "angle_rub_at",
)

PLANT = np.dtype(
    [
        (name, np.float64)
        for name in (
            *_DECLARED, *_RATED, *_FRICTION, *_LOAD, *_ELECTRICAL, *_THERMAL, *_SENSOR, *_UNLISTED
        )
    ]
)  # fmt: skip

DRIVE = np.dtype(
    [
        (name, np.float64)
        for name in (
            "start",  # start of the present interval [s]
            "voltage",
            "voltage_slope",
            "temperature",
            "temperature_slope",
            "peak",  # highest magnet temperature so far [degC]
            "direction",  # mode of dry friction: 1 or -1 sliding, 0 sticking
        )
    ]
)
"""Inputs of the plant between two instants: voltage, temperature, and mode of dry friction."""


def clean_plant(motor: Motor) -> Plant:
    """Plant record of a motor that follows the nominal model exactly.

    Args:
        motor: Source of the nominal parameters and rated values.
    """
    plant: np.void = np.zeros(1, PLANT)[0]
    for name in _DECLARED:
        plant[name] = getattr(motor, name)
    for name in _RATED:
        plant[name] = getattr(motor, name)
    return plant


def new_drive() -> np.void:
    """Empty drive record."""
    drive: np.void = np.zeros(1, DRIVE)[0]
    return drive
