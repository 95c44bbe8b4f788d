"""Which effects have a picture, in which balance and against what."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.model.term import AbstractTerm, AbstractTorque, AbstractVoltage
from identification.report.along import Along

__all__ = [
    "AGAINST",
    "CHANGES",
    "UNITS",
    "WORDS",
    "carrier_of",
    "column_of",
    "drivers_of",
    "has_a_curve",
    "has_a_picture",
    "undrawn_sentence",
]

UNITS: Final = ("V", "N m")
"""Of what the two balances miss: column 0 is the armature loop, column 1 the shaft."""

WORDS: Final = ("missing voltage", "missing torque")
AGAINST: Final = ("current", "motion")
"""What a voltage and a torque are turned against."""

CHANGES: Final = {
    "Ra": (0, "change of Ra", "ohm"),
    "Kt": (0, "change of Kt", "N m/A"),
    "b": (1, "change of b", "N m s/rad"),
}
"""Coefficients whose change is drawn: in which balance it shows, in words, and its unit.  A change
of L shows in the few samples behind a step of the voltage, too few for a smoother."""


def undrawn_sentence(terms: Sequence[AbstractTerm]) -> str:
    """What to say of the effects that have no picture; empty where all have one."""
    names = [term.name.replace("_", " ") for term in terms if not has_a_picture(term)]
    if not names:
        return ""
    return (
        f"{' and '.join(names).capitalize()} {'is' if len(names) == 1 else 'are'} in the log and "
        "not in the motor, so there is no missing voltage or torque to draw."
    )


def has_a_picture(term: AbstractTerm) -> bool:
    """Whether the effect is a voltage or a torque in the motor, and not one of the log."""
    return term.equation != "sensor"


def has_a_curve(term: AbstractTerm) -> bool:
    """Whether the effect is a function of its drivers, and of nothing that went before."""
    kinds = (AbstractTorque, AbstractVoltage)
    plain = isinstance(term, kinds) or getattr(term, "coefficient", "") in CHANGES
    return has_a_picture(term) and plain and not term.states and "time" not in drivers_of(term)


def drivers_of(term: AbstractTerm) -> tuple[str, ...]:
    """What to draw the effect against; a constant is drawn against the speed."""
    if term.name == "demagnetization":
        return ("peak_temperature",)
    if term.name == "viscous_temperature":
        return ("temperature",)
    carrier = carrier_of(term)
    return tuple(name for name in term.drivers[:2] if name != carrier) or ("speed",)


def carrier_of(term: AbstractTerm) -> str:
    """The driver that only gives an effect of two drivers its sign; empty where there is none."""
    carrier = "speed" if term.equation == "mechanical" else "current"
    plain = isinstance(term, AbstractTorque | AbstractVoltage)
    return carrier if plain and len(term.drivers) == 2 and carrier in term.drivers else ""


def column_of(term: AbstractTerm, found: Along) -> int:
    """The balance in which an effect is drawn: the one that it is listed under, or acts in."""
    if isinstance(term, AbstractTorque) or getattr(term, "coefficient", "") in ("b", "J"):
        return 1
    if term.equation == "mechanical":
        return 1 if np.any(found.effects[term.name][0, :, 1]) else 0
    return 0
