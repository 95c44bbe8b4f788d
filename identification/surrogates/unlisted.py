"""Terms outside the catalogue, named `unlisted`: spline curves, ripples and a few laws."""

from __future__ import annotations

from typing import Final

from identification.effects.effect import AbstractEffect
from identification.surrogates.coefficient import (
    ResistanceChange,
    ResistanceOfRuns,
    TorqueConstantChange,
    TorqueConstantOfRuns,
)
from identification.surrogates.curves import MissingTorque, MissingVoltage
from identification.surrogates.dead_zone import SensorDeadZone
from identification.surrogates.gain import (
    SensorGain,
    SensorGainOfRuns,
    VoltageGain,
    VoltageGainOfRuns,
)
from identification.surrogates.gear import GearFriction
from identification.surrogates.high_pass import SensorHighPass
from identification.surrogates.laws import (
    AngularFriction,
    Backlash,
    CurrentSaturation,
    DahlFriction,
    SupplySag,
)
from identification.surrogates.ripple import MissingTorqueRipple, MissingVoltageRipple, SpeedRipple
from identification.surrogates.run_in import DryFrictionOfRuns, ViscousFrictionOfRuns
from identification.surrogates.spring import ReturnSpring

__all__ = ["LAWS", "SURROGATES"]

SURROGATES: Final[tuple[type[AbstractEffect], ...]] = (
    MissingTorque,
    MissingVoltage,
    MissingTorqueRipple,
    MissingVoltageRipple,
    AngularFriction,
    DahlFriction,
    Backlash,
    CurrentSaturation,
    DryFrictionOfRuns,
    ResistanceChange,
    TorqueConstantChange,
    ResistanceOfRuns,
    TorqueConstantOfRuns,
)
"""Terms that the search tries if no effect of its catalogue explains the residual."""

LAWS: Final[tuple[type[AbstractEffect], ...]] = (
    SupplySag,
    GearFriction,
    SpeedRipple,
    ReturnSpring,
    SensorDeadZone,
    SensorHighPass,
    SensorGain,
    VoltageGain,
    SensorGainOfRuns,
    VoltageGainOfRuns,
    ViscousFrictionOfRuns,
)
"""Physical laws outside the catalogue that the search tries together with its effects."""
