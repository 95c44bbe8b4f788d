"""Confounded effects: what current, speed and temperature alone cannot tell apart.

These limits come from physics, not from the method.  The documentation lists them all; a report
lists those that concern its effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

__all__ = ["CONFUSIONS", "Confusion", "confusions_of"]


@dataclass(frozen=True)
class Confusion:
    """Effects and parameters that are confounded with each other.

    Args:
        effects: Names in the catalogue.
        parameters: Nominal-model parameters that are confounded with them.
        title: The confounded quantities in words.
        apart: What tells them apart, or that nothing does.
    """

    effects: tuple[str, ...]
    parameters: tuple[str, ...]
    title: str
    apart: str


CONFUSIONS: Final = (
    Confusion(
        ("brush_drop",),
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
    ),
    Confusion(
        ("coulomb_friction", "stribeck_friction", "quadratic_drag", "viscous_temperature"),
        ("b",),
        "components of friction",
        "The speeds of the runs separate Coulomb friction, Stribeck friction, viscous friction "
        "and drag: standstill and reversals determine the first two, the highest speeds the "
        "last. Friction that is proportional to the load of a gear or bearing depends on the "
        "current and appears as Coulomb friction if load and direction change together.",
    ),
    Confusion(
        ("flux_saturation", "demagnetization", "magnet_lag"),
        ("Kt25", "alpha_Kt"),
        "three causes of a lower torque constant",
        "Flux saturation follows the current without delay and equally in both directions, "
        "demagnetisation is permanent after a single temperature peak, and the change by the "
        "temperature coefficient reverses when the magnet cools. The runs must include cooling "
        "after the hottest run, and different currents at one temperature.",
    ),
    Confusion(
        ("self_heating", "winding_lag", "resistance_curvature"),
        ("alpha_Ra",),
        "three causes of a resistance that is not linear in the logged temperature",
        "Self-heating is determined by runs with high current at constant logged temperature, a "
        "lag of the thermometer by fast heating, and the second-order temperature coefficient by "
        "a wide temperature range.",
    ),
    Confusion(
        ("channel_delay", "current_filter", "speed_filter", "input_hold", "inductance_saturation"),
        ("L",),
        "delay, filter, inter-sample behaviour and inductance",
        "Each of them delays a response by less than a few samples. Only a sample interval "
        "shorter than the electrical time constant, together with steps of small and large size, "
        "separates them.",
    ),
    Confusion(
        ("current_offset", "load_torque"),
        (),
        "zero error of the current and constant load",
        "If the torque constant does not change, both act as a constant torque. They are "
        "separable if the torque constant changes with temperature, or if the voltage balance "
        "determines the current.",
    ),
    Confusion(
        ("voltage_offset", "speed_offset"),
        (),
        "zero errors of voltage and speed",
        "An offset of the speed is a constant back-EMF and therefore a constant voltage. Viscous "
        "friction and standstill separate the two.",
    ),
    Confusion(
        ("load_step", "inertia_change"),
        ("J",),
        "effects that occur in a single run",
        "The torque of an added inertia is proportional to the acceleration, the torque of a "
        "load step is not. A single run does not show whether the next run will have the effect.",
    ),
    Confusion(
        (),
        ("b",),
        "viscous friction and eddy-current loss",
        "Both give a braking torque proportional to speed. The laws are identical and cannot be "
        "separated; b is their sum.",
    ),
    Confusion(
        (),
        ("Kt25", "J", "b"),
        "common factor of torque",
        "A common factor of torque, inertia and friction changes no logged signal. The torque "
        "constant is therefore set equal to the back-EMF constant.",
    ),
)
"""Known confounded effects; entries without an effect concern every motor."""


def confusions_of(names: Sequence[str]) -> list[Confusion]:
    """Entries that concern one of the effects in `names`."""
    return [confusion for confusion in CONFUSIONS if set(confusion.effects) & set(names)]
