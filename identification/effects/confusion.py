"""Confounded effects: what current, speed and temperature alone cannot tell apart.

These limits come from physics, not from the method.  Each effect declares its confusions.  The
documentation lists them all; a report lists those that concern its effects.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = [
    "BRUSHES",
    "CONFUSIONS",
    "CONSTANT_TORQUE",
    "CONSTANT_VOLTAGE",
    "FRICTION",
    "INDUCTANCE",
    "RESISTANCE",
    "SINGLE_RUN",
    "TORQUE_CONSTANT",
    "Confusion",
]


@dataclass(frozen=True)
class Confusion:
    """Confounding of effects with each other or with parameters of the nominal model."""

    parameters: tuple[str, ...]
    """Nominal-model parameters that are confounded with the effects."""
    title: str
    """The confounded quantities in words."""
    apart: str
    """Measurement that separates them, or the statement that none does."""


BRUSHES: Final = Confusion(
    ("Ra25",),
    "brush drop and armature resistance",
    "At currents above the knee, a constant drop and a resistance differ only in the "
    "intercept of voltage over current. The runs must cross the knee in both directions of "
    "the current. If the logged voltage is the commanded one, the dead time of the output "
    "stage causes a voltage with the sign of the current, as a brush drop does, and leads "
    "and switches are in series with the armature; only the voltage measured at the "
    "terminals separates these. The voltage lost in a sagging chopper supply is "
    "proportional to the current and to the square of the commanded voltage; it is "
    "distinguishable and reported as unlisted.",
)

FRICTION: Final = Confusion(
    ("b",),
    "components of friction",
    "The speeds of the runs separate Coulomb friction, Stribeck friction, viscous friction "
    "and drag: standstill and reversals determine the first two, the highest speeds the "
    "last. Friction that is proportional to the torque through a gear or bearing appears as "
    "Coulomb friction if that torque is constant, as the weight of a hoist; if it accelerates "
    "an inertia, it is reported as unlisted.",
)

TORQUE_CONSTANT: Final = Confusion(
    ("Kt25", "alpha_Kt"),
    "three causes of a lower torque constant",
    "Flux saturation follows the current without delay and equally in both directions, "
    "demagnetisation is permanent after a single temperature peak, and the change by the "
    "temperature coefficient reverses when the magnet cools. The runs must include cooling "
    "after the hottest run, and different currents at one temperature.",
)

RESISTANCE: Final = Confusion(
    ("alpha_Ra",),
    "three causes of a resistance that is not linear in the logged temperature",
    "Self-heating is determined by runs with high current at constant logged temperature, a "
    "lag of the thermometer by fast heating, and the second-order temperature coefficient by "
    "a wide temperature range.",
)

INDUCTANCE: Final = Confusion(
    ("L",),
    "delay, filter, inter-sample behaviour and inductance",
    "Each of them delays a response by less than a few samples. Only a sample interval "
    "shorter than the electrical time constant, together with steps of small and large size, "
    "separates them.",
)

CONSTANT_TORQUE: Final = Confusion(
    (),
    "zero error of the current and constant load",
    "If the torque constant does not change, both act as a constant torque. They are "
    "separable if the torque constant changes with temperature, or if the voltage balance "
    "determines the current.",
)

CONSTANT_VOLTAGE: Final = Confusion(
    (),
    "zero errors of voltage and speed",
    "An offset of the speed is a constant back-EMF and therefore a constant voltage. Viscous "
    "friction and standstill separate the two.",
)

SINGLE_RUN: Final = Confusion(
    ("J",),
    "effects that occur in a single run",
    "The torque of an added inertia is proportional to the acceleration, the torque of a "
    "load step is not. A single run does not show whether the next run will have the effect.",
)

_VISCOUS: Final = Confusion(
    ("b",),
    "viscous friction and eddy-current loss",
    "Both give a braking torque proportional to speed. The laws are identical and cannot be "
    "separated; b is their sum.",
)

_TORQUE_FACTOR: Final = Confusion(
    ("Kt25", "J", "b"),
    "common factor of torque",
    "A common factor of torque, inertia and friction changes no logged signal. The torque "
    "constant is therefore set equal to the back-EMF constant.",
)

CONFUSIONS: Final = (
    BRUSHES,
    FRICTION,
    TORQUE_CONSTANT,
    RESISTANCE,
    INDUCTANCE,
    CONSTANT_TORQUE,
    CONSTANT_VOLTAGE,
    SINGLE_RUN,
    _VISCOUS,
    _TORQUE_FACTOR,
)
"""Known confusions, in the order of the documentation; those of no effect concern every motor."""
