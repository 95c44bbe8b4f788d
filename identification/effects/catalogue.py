"""Catalogue of the effects: classes by name.

A new effect needs a class in one of the modules of this package and a line in `CATALOGUE`.
"""

from __future__ import annotations

from typing import Any, Final

from identification.effects.cogging import CoggingTorque
from identification.effects.electrical import BrushDrop, FluxSaturation, InductanceSaturation
from identification.effects.friction import (
    CoulombFriction,
    QuadraticDrag,
    StribeckFriction,
    ViscousTemperature,
)
from identification.effects.lag import MagnetLag, WindingLag
from identification.effects.load import InertiaChange, LoadStep, LoadTorque, ShaftCompliance
from identification.effects.sensor import (
    ChannelDelay,
    CurrentFilter,
    InputHold,
    SpeedFilter,
)
from identification.effects.thermal import (
    Demagnetization,
    ResistanceCurvature,
    SelfHeating,
)
from identification.effects.zero import CurrentOffset, SpeedOffset, VoltageOffset

__all__ = ["CATALOGUE"]

CATALOGUE: Final[dict[str, Any]] = {
    "coulomb_friction": CoulombFriction,
    "stribeck_friction": StribeckFriction,
    "quadratic_drag": QuadraticDrag,
    "viscous_temperature": ViscousTemperature,
    "load_torque": LoadTorque,
    "load_step": LoadStep,
    "cogging_torque": CoggingTorque,
    "inertia_change": InertiaChange,
    "shaft_compliance": ShaftCompliance,
    "brush_drop": BrushDrop,
    "flux_saturation": FluxSaturation,
    "inductance_saturation": InductanceSaturation,
    "self_heating": SelfHeating,
    "winding_lag": WindingLag,
    "magnet_lag": MagnetLag,
    "resistance_curvature": ResistanceCurvature,
    "demagnetization": Demagnetization,
    "current_offset": CurrentOffset,
    "voltage_offset": VoltageOffset,
    "speed_offset": SpeedOffset,
    "channel_delay": ChannelDelay,
    "speed_filter": SpeedFilter,
    "current_filter": CurrentFilter,
    "input_hold": InputHold,
}
