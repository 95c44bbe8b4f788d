"""Public names and units of parameters and channels, defined once.

Names of parameters, channels and effects are part of the interface: a result file of today is read
by a script of next year.  No other module of the package writes these units.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CHANNEL_UNITS", "DECLARED_PARAMETERS", "REFERENCE_TEMPERATURE_DEGC", "Declared"]

REFERENCE_TEMPERATURE_DEGC = 25.0

CHANNEL_UNITS = {
    "time_s": "s",
    "voltage_V": "V",
    "current_A": "A",
    "speed_rad_s": "rad/s",
    "temperature_degC": "degC",
    "position_rad": "rad",
}


@dataclass(frozen=True)
class Declared:
    """One parameter of the nominal model: its name, unit and meaning."""

    name: str
    unit: str
    meaning: str


DECLARED_PARAMETERS = {
    parameter.name: parameter
    for parameter in (
        Declared("Ra25", "ohm", "armature resistance at 25 degC"),
        Declared("alpha_Ra", "1/K", "temperature coefficient of the resistance"),
        Declared("Kt25", "N m/A", "torque and back-EMF constant at 25 degC"),
        Declared("alpha_Kt", "1/K", "temperature coefficient of the torque constant"),
        Declared("J", "kg m^2", "inertia"),
        Declared("b", "N m s/rad", "viscous friction"),
        Declared("L", "H", "armature inductance"),
    )
}
