"""Nominal model: voltage and torque balance with temperature-dependent coefficients.

    L di/dt = v - Ra(T) i - Kt(T) w          Ra(T) = Ra25 (1 + alpha_Ra (T - 25))
    J dw/dt = Kt(T) i - b w                  Kt(T) = Kt25 (1 + alpha_Kt (T - 25))

In SI units the back-EMF constant equals the torque constant, so one Kt serves both equations.

Source: Sidahmed and Mahmoud, Int. J. Advance Research in Computer Science and Management
Studies 2(9), 2014, pages 384-388, equations 1-6, 11 and 12.
"""

from __future__ import annotations

from dataclasses import replace

from identification.model.parameter import Parameter
from identification.model.term import Expression
from identification.quantities import DECLARED_PARAMETERS, REFERENCE_TEMPERATURE_DEGC

__all__ = ["DECLARED", "coefficient_at", "current_rate", "speed_rate"]


def _declared(name: str) -> Parameter:
    known = DECLARED_PARAMETERS[name]
    return Parameter(name, known.unit, known.meaning)


DECLARED = (
    replace(_declared("Ra25"), search="log"),
    # Copper 0.0039, aluminium 0.0043 1/K (CRC Handbook of Chemistry and Physics, electrical
    # resistivity of pure metals); brushes and leads in series lower the total.
    replace(_declared("alpha_Ra"), scale=1e-3, prior_mean=0.0035, prior_sd=3.0),
    replace(_declared("Kt25"), search="log"),
    # Temperature coefficients of remanence: ferrite -0.0020, NdFeB -0.0012, SmCo -0.0004, AlNiCo
    # -0.0002 1/K (MMPA standard 0100-00, table of magnetic materials).
    replace(_declared("alpha_Kt"), scale=1e-3, prior_mean=-0.001, prior_sd=2.0),
    replace(_declared("J"), search="log"),
    replace(_declared("b"), lower=0.0),
    replace(_declared("L"), lower=0.0),
)
"""Parameters of the nominal model.

The starting values of a fit set the prior centres of Ra25, Kt25, J, b and L, and the scales of b
and L (`fit/declared.py`)."""


def coefficient_at(reference: Expression, slope: Expression, temperature: Expression) -> Expression:
    """Ra(T) or Kt(T) from its value at 25 degC and its slope [1/K] (equations 11 and 12)."""
    return reference * (1 + slope * (temperature - REFERENCE_TEMPERATURE_DEGC))


def current_rate(
    voltage: Expression,
    current: Expression,
    speed: Expression,
    resistance: Expression,
    constant: Expression,
    inductance: Expression,
) -> Expression:
    """Current derivative di/dt from the armature voltage balance (equations 2 to 4) [A/s]."""
    return (voltage - resistance * current - constant * speed) / inductance


def speed_rate(
    torque: Expression,
    current: Expression,
    speed: Expression,
    constant: Expression,
    friction: Expression,
    inertia: Expression,
) -> Expression:
    """Acceleration dw/dt from the shaft torque balance (equations 1, 5 and 6) [rad/s^2].

    `torque` is the sum of all torques except Kt i and viscous friction [N m].
    """
    return (constant * current - friction * speed + torque) / inertia
