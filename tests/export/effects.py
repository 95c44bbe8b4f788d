"""Every effect that an export can hold, as the entry of a result."""

from __future__ import annotations

from typing import Any, Final

from tests.export.results import (
    COGGING,
    DELAY,
    FILTER,
    FRICTION,
    HEATING,
    HOLD,
    INTERVAL,
    MEAN,
    effect,
)

__all__ = ["EFFECTS", "NOT_EXPORTED", "OWN_PHASE"]

NOT_EXPORTED: Final = {"load_step", "inertia_change", "voltage_filter"}
"""Effects of single runs, or of the logged voltage only."""

OWN_PHASE: Final = effect(
    "cogging_torque", {"torque_size": 0.1, "angle": "integrated", "logged": False}, order=14.0
)
"""Cogging whose phase belongs to each run, so that its amplitudes are states."""

_LAG: Final = {"fastest": 0.003, "slowest": 3600.0}
_SENSOR: Final = {"fastest": 1e-4, "slowest": 0.3, "order": 1}

EFFECTS: Final[dict[str, dict[str, Any]]] = {
    "coulomb_friction": FRICTION,
    "stribeck_friction": effect(
        "stribeck_friction", {"torque_size": 0.1, "speed_size": 200.0, "width": 0.2},
        torque=0.03, speed=50.0, exponent=1.0,
    ),
    "quadratic_drag": effect(
        "quadratic_drag", {"torque_size": 0.1, "reference": 200.0, "direction": 0},
        torque=0.05, exponent=1.7, asymmetry=0.1,
    ),
    "viscous_temperature": effect("viscous_temperature", {}, rate=0.01, form=0.2),
    "load_torque": effect("load_torque", {"torque_size": 0.1}, torque=0.05),
    "cogging_torque": COGGING,
    "shaft_compliance": effect(
        "shaft_compliance", {"torque_size": 0.1, "slowest": 30.0, "fastest": 2500.0},
        share=0.5, resonance=900.0, damping=0.1, hardening=0.2,
    ),
    "brush_drop": effect(
        "brush_drop", {"voltage_size": 15.0, "current_size": 14.0, "is_heated": False},
        voltage=0.9, knee=0.8, sharpness=2.0, openness=1.0, asymmetry=0.1,
    ),
    "flux_saturation": effect(
        "flux_saturation", {"reference": 20.0, "is_exponential": False},
        fall=0.2, exponent=2.0, lasting=0.95,
    ),
    "inductance_saturation": effect(
        "inductance_saturation", {"reference": 20.0, "is_exponential": False},
        fall=2.0, exponent=2.0, leakage=0.3,
    ),
    "self_heating": HEATING,
    "winding_lag": effect(
        "winding_lag", {**_LAG, "direction": "the winding lags the log"}, time_constant=0.6
    ),
    "magnet_lag": effect("magnet_lag", _LAG, time_constant=0.6),
    "resistance_curvature": effect("resistance_curvature", {}, curvature=5e-6),
    "demagnetization": effect(
        "demagnetization", {"coldest": 20.0, "hottest": 80.0},
        loss=0.05, temperature=61.0, width=2.0,
    ),
    "current_offset": effect("current_offset", {"size": 14.0}, offset=0.3),
    "voltage_offset": effect("voltage_offset", {"size": 15.0}, offset=0.2),
    "speed_offset": effect("speed_offset", {"size": 170.0}, offset=2.0),
    "channel_delay": DELAY,
    "speed_filter": effect("speed_filter", _SENSOR, time_constant=5e-3),
    "speed_filter, a mean": MEAN,
    "speed_filter, a mean of samples": effect(
        "speed_filter", {"interval": INTERVAL, "memory": 15}, time_constant=3.2e-3
    ),
    "current_filter": FILTER,
    "input_hold": HOLD,
}  # fmt: skip
"""Values of a size that the 100 W servo may have."""
