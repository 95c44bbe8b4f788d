"""Brushed permanent-magnet motors of 12, 24 and 48 V and 5 to 500 W, drawn by documented scaling.

Electrical loading and losses: Hughes and Drury, Electric Motors and Drives, 5th edition (2019),
section 1.6: specific output and efficiency grow with size, the speed of standard motors falls.
Mechanical time constants of 4 to 30 ms, electrical ones of 0.1 to 2 ms, and viscous and dry losses
of a few per cent of the rated torque: Electro-Craft, DC Motors, Speed Controls, Servo Systems, 5th
edition (1980), chapter 2.
Copper: 1 / (234.5 + 25) per kelvin, IEC 60034-1, section 8.6.2.
Magnets (ferrite, NdFeB, SmCo): reversible temperature coefficients of the remanence from
magnet data sheets, -0.20, -0.11 and -0.04 % per kelvin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

__all__ = ["BenchMotor", "drawn_motor"]

_MAGNETS = (-0.0020, -0.0011, -0.0004)


@dataclass(frozen=True)
class BenchMotor:
    """A motor with its rated values.

    Args:
        rated_voltage: [V].
        rated_power: At the shaft [W].
        rated_current: [A].
        rated_speed: [rad/s].
        Ra25: Armature resistance at 25 degC [ohm].
        alpha_Ra: Its temperature coefficient [1/K].
        Kt25: Torque and back-EMF constant at 25 degC [N m/A].
        alpha_Kt: Its temperature coefficient [1/K].
        J: Inertia [kg m^2].
        b: Viscous friction [N m s/rad].
        L: Armature inductance [H].
    """

    rated_voltage: float
    rated_power: float
    rated_current: float
    rated_speed: float
    Ra25: float
    alpha_Ra: float
    Kt25: float
    alpha_Kt: float
    J: float
    b: float
    L: float

    @property
    def rated_torque(self) -> float:
        """Torque at the rated current [N m]."""
        return self.Kt25 * self.rated_current

    @property
    def mechanical_time_constant(self) -> float:
        """Of the unloaded motor [s]."""
        return self.J * self.Ra25 / self.Kt25**2


def drawn_motor(rng: np.random.Generator) -> BenchMotor:
    """Draw a motor; the voltage classes overlap in power.

    Args:
        rng: Random generator.
    """
    power = 5.0 * 100.0 ** rng.uniform()
    weights = np.array([1.2 - 0.5 * np.log10(power), 1.0, 0.4 * np.log10(power)]).clip(0.05)
    voltage = float(rng.choice([12.0, 24.0, 48.0], p=weights / weights.sum()))
    efficiency = 1.0 - 0.42 * (power / 5.0) ** -0.22 * rng.lognormal(0.0, 0.15)
    efficiency = float(np.clip(efficiency, 0.45, 0.92))
    speed = 520.0 * (power / 50.0) ** -0.1 * rng.lognormal(0.0, 0.25)
    current = power / (voltage * efficiency)
    # Most losses are copper losses; the rest is friction, modelled by b and the effects.
    resistance = 0.8 * (1.0 - efficiency) * voltage / current
    torque_constant = (voltage - resistance * current) / speed
    mechanical = 0.012 * rng.lognormal(0.0, 0.4)
    electrical = 4e-4 * (power / 50.0) ** 0.2 * rng.lognormal(0.0, 0.5)
    return BenchMotor(
        rated_voltage=voltage,
        rated_power=power,
        rated_current=current,
        rated_speed=speed,
        Ra25=resistance,
        alpha_Ra=1.0 / (234.5 + 25.0),
        Kt25=torque_constant,
        alpha_Kt=float(rng.choice(_MAGNETS)) * rng.uniform(0.9, 1.1),
        J=mechanical * torque_constant**2 / resistance,
        b=rng.uniform(0.02, 0.06) * torque_constant * current / speed,
        L=float(np.clip(electrical, 1e-4, 2e-3)) * resistance,
    )
