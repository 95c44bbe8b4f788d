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
        "Away from the knee a drop of constant size and a resistance differ only by where the "
        "line of voltage over current meets zero. Runs must take the current through the knee, in "
        "both directions. Where the voltage is logged as commanded, the dead time of the output "
        "stage takes a voltage with the sign of the current, which is the law of a brush drop, and "
        "leads and switches are in series with the armature: only a voltage measured at the "
        "terminals parts these. A supply that sags behind a chopper goes with the square of the "
        "voltage as well; it is told apart and called unlisted.",
    ),
    Confusion(
        ("coulomb_friction", "stribeck_friction", "quadratic_drag", "viscous_temperature"),
        ("b",),
        "the shares of friction",
        "Dry friction, its rise at low speed, viscous friction and drag are told apart by the "
        "speeds of the runs: standstill and reversals for the first two, the highest speeds for "
        "the last. Friction that grows with the load of the gear or bearing goes with the current "
        "and passes for dry friction where load and direction change together.",
    ),
    Confusion(
        ("flux_saturation", "demagnetization", "magnet_lag"),
        ("Kt25", "alpha_Kt"),
        "three ways to lose torque constant",
        "Saturation follows the current at once and alike in both directions, demagnetisation "
        "stays after one hot moment, and the temperature coefficient comes back when the magnet "
        "cools. Runs must cool down again after the hottest one, and change the current at one "
        "temperature.",
    ),
    Confusion(
        ("self_heating", "winding_lag", "resistance_curvature"),
        ("alpha_Ra",),
        "three ways for the resistance to leave its line",
        "Own losses, a lag of the thermometer and a second-order law of the metal part by runs "
        "with strong current at a steady temperature, by fast heating, and by a wide range of "
        "temperature.",
    ),
    Confusion(
        ("channel_delay", "current_filter", "speed_filter", "input_hold", "inductance_saturation"),
        ("L",),
        "delay, filter, voltage between samples and inductance",
        "All of them hold a response back by less than a few samples. Only samples closer than "
        "the electrical time constant, and steps of both small and large size, part them.",
    ),
    Confusion(
        ("current_offset", "load_torque"),
        (),
        "zero error of the current and constant load",
        "With a constant torque constant both are a constant torque. They part where temperature "
        "changes the constant, or where the voltage balance shows the current.",
    ),
    Confusion(
        ("voltage_offset", "speed_offset"),
        (),
        "zero errors of voltage and speed",
        "An offset of the speed is a constant back-EMF, which is a constant voltage. Viscous "
        "friction and standstill part them.",
    ),
    Confusion(
        ("load_step", "inertia_change"),
        ("J",),
        "what happens in one run alone",
        "A load that came and went and another inertia are told apart by whether the torque "
        "follows the acceleration. One run cannot say whether the next will have it.",
    ),
    Confusion(
        (),
        ("b",),
        "viscous friction and eddy-current loss",
        "Both brake in proportion to speed. They are the same law and cannot be separated; b holds "
        "both.",
    ),
    Confusion(
        (),
        ("Kt25", "J", "b"),
        "the scale of torque",
        "A common factor on torque, inertia and friction changes nothing that is logged. The "
        "back-EMF constant is therefore taken for the torque constant.",
    ),
)
"""Known confounded effects; entries without an effect concern every motor."""


def confusions_of(names: Sequence[str]) -> list[Confusion]:
    """Entries that concern one of the effects in `names`."""
    return [confusion for confusion in CONFUSIONS if set(confusion.effects) & set(names)]
