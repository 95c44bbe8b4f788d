"""Causes of a change between two campaigns of one motor, as directions in parameter space.

A cause changes some parameters together and leaves the others as they are.  Each of its directions
gives the relative changes of the parameters for one unit of change; the size of the change is not
known, its sign is.  The relations follow from the two equations of the nominal model:

    v = Ra i + L di/dt + Kt w        J dw/dt = Kt i - b w - T_c sgn w

A new cause is one entry in `CAUSES`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

__all__ = ["CAUSES", "Cause", "Direction"]

Direction = Mapping[str, float]
"""Relative change by parameter, or by size of an effect such as ``coulomb_friction.torque`` [-]."""

_COULOMB: Final = "coulomb_friction.torque"
_DROP: Final = "brush_drop.voltage"
_THINNING: Final = "viscous_temperature.rate"


@dataclass(frozen=True)
class Cause:
    """Cause of a change."""

    name: str
    meaning: str
    """Name of the cause in words."""
    check: str
    """First check on the motor or the bench."""
    directions: Callable[[Mapping[str, float]], Sequence[Direction]]
    """Directions of the change from given values; parameters not compared are ignored."""


def _either(*directions: Direction) -> Callable[[Mapping[str, float]], Sequence[Direction]]:
    return lambda before: directions


def _both_signs(direction: Direction) -> list[Direction]:
    return [direction, {name: -share for name, share in direction.items()}]


def _of_thermometer(before: Mapping[str, float]) -> list[Direction]:
    """Offset and gain of the logged temperature, either sign of both.

    With the logged temperature T' = T + c the apparent resistance at 25 degC is
    Ra25 (1 - alpha_Ra c), and Ra25 alpha_Ra remains; likewise for Kt.  A gain divides both
    temperature coefficients.  The offset is scaled to the change of Ra25.
    """
    gain = _both_signs({"alpha_Ra": 1.0, "alpha_Kt": 1.0})
    winding, magnet = before.get("alpha_Ra"), before.get("alpha_Kt")
    if not winding or magnet is None:
        return gain
    share = magnet / winding
    offset = {"Ra25": 1.0, "alpha_Ra": -1.0, "Kt25": share, "alpha_Kt": -share}
    return [*_both_signs(offset), *gain]


# A contact is a series resistance without the temperature coefficient of copper, or a voltage drop.
# The resistance r adds to Ra25; Ra25 alpha_Ra remains, so alpha_Ra falls as Ra25 rises.
_WORSE_CONTACT: Final = (
    {"Ra25": 1.0, "alpha_Ra": -1.0},
    {_DROP: 1.0},
    *({"Ra25": share, "alpha_Ra": -share, _DROP: 1.0} for share in (0.1, 0.5, 2)),
)

CAUSES: Final = (
    # The reversible coefficient alpha_Kt remains.
    Cause(
        "demagnetization",
        "the magnets have lost flux",
        "overcurrent and overheating since the last campaign",
        _either({"Kt25": -1.0}),
    ),
    Cause(
        "brush_wear",
        "worn brushes, or a worse contact of the leads",
        "length and pressure of the brushes, terminals",
        _either(*_WORSE_CONTACT),
    ),
    Cause(
        "better_contact",
        "new or bedded brushes, or cleaned contacts",
        "whether brushes or leads were changed",
        _either(*(_both_signs(one)[1] for one in _WORSE_CONTACT)),
    ),
    Cause(
        "run_in",
        "bearings or brushes have run in",
        "operating hours since assembly",
        _either(
            {"b": -1.0}, {_COULOMB: -1.0}, *({"b": -s, _COULOMB: -1.0} for s in (0.3, 1.0, 3.0))
        ),
    ),
    Cause(
        "grease",
        "aged, stiff or cold grease",
        "lubrication, and the temperature of the bearings",
        _either({"b": 1.0}, *({"b": 1.0, _THINNING: share} for share in (0.3, 1.0))),
    ),
    Cause(
        "bearing_wear",
        "worn, dirty or preloaded bearings",
        "noise and play of the bearings, alignment of the coupling",
        _either({_COULOMB: 1.0}, *({_COULOMB: 1.0, "b": share} for share in (0.1, 0.3, 1.0))),
    ),
    Cause(
        "load_inertia",
        "another inertia on the shaft",
        "coupling, encoder and load",
        _either(*_both_signs({"J": 1.0})),
    ),
    # Ra25 and Kt25 are proportional to the number of active turns, L to its square.
    Cause(
        "shorted_turns",
        "shorted turns of the winding",
        "insulation and commutator",
        _either({"Ra25": -1.0, "Kt25": -1.0, "L": -2.0}),
    ),
    Cause(
        "thermometer",
        "another position or calibration of the thermometer",
        "where the temperature is measured, also against a second thermometer at rest",
        _of_thermometer,
    ),
    # Resistances fall by the gain, torques per ampere rise; the back-EMF fixes Kt25.
    Cause(
        "current_gain",
        "another gain of the current sensor",
        "calibration and range of the current sensor",
        _either(*_both_signs({"Ra25": -1.0, "L": -1.0, "J": 1.0, "b": 1.0, _COULOMB: 1.0})),
    ),
    # All voltages and, by Kt25, all torques scale with the gain.
    Cause(
        "voltage_gain",
        "another gain of the voltage measurement",
        "voltage divider, and where the voltage is measured",
        _either(*_both_signs(dict.fromkeys(("Ra25", "Kt25", "L", "J", "b", _COULOMB, _DROP), 1.0))),
    ),
    # Kt25 and torques fall by the gain, J and b by its square.
    Cause(
        "speed_gain",
        "another gain of the speed measurement",
        "pulses per turn of the encoder, or the tachometer constant",
        _either(*_both_signs({"Kt25": -1.0, "J": -2.0, "b": -2.0, _COULOMB: -1.0})),
    ),
)
"""All causes in the order of tables; changes of the motor first, of the bench last."""
