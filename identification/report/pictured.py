"""Plot selection for each effect: equation, drivers and labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.effects.effect import AbstractEffect
from identification.model.term import (
    AbstractCoefficient,
    AbstractTerm,
    AbstractTorque,
    AbstractVoltage,
)
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
"""Units of the missing terms: column 0 is the electrical equation, column 1 the mechanical one."""

WORDS: Final = ("missing voltage", "missing torque")
AGAINST: Final = ("current", "motion")
"""Direction that a positive missing voltage or torque opposes, for the axis label."""

CHANGES: Final = {
    "Ra": (0, "change of Ra", "ohm"),
    "Kt": (0, "change of Kt", "N m/A"),
    "b": (1, "change of b", "N m s/rad"),
}
"""Coefficients whose change is plotted: column of the equation, axis label and unit.  A change of L
shows only in the few samples after a voltage step, too few for the smoother."""


def undrawn_sentence(terms: Sequence[AbstractTerm]) -> str:
    """Report sentence on the effects that cannot be plotted; empty if all can."""
    names = [term.name.replace("_", " ") for term in terms if not has_a_picture(term)]
    if not names:
        return ""
    return (
        f"{' and '.join(names).capitalize()} {_verb(names)} on the logged signals and "
        "not in the motor, so there is no missing voltage or torque to plot."
    )


def _verb(names: Sequence[str]) -> str:
    return "acts" if len(names) == 1 else "act"


def has_a_picture(term: AbstractTerm) -> bool:
    """Whether the effect acts in the motor and not in a sensor."""
    return term.equation != "sensor"


def has_a_curve(term: AbstractEffect) -> bool:
    """Whether the effect is a static function of its drivers and does not depend on time."""
    changes = isinstance(term, AbstractCoefficient) and term.coefficient in CHANGES
    plain = isinstance(term, AbstractTorque | AbstractVoltage) or changes
    return has_a_picture(term) and plain and not term.states and "time" not in drivers_of(term)


def drivers_of(term: AbstractEffect) -> tuple[str, ...]:
    """Drivers to plot the effect against; a constant effect is plotted against the speed."""
    carrier = carrier_of(term)
    return tuple(name for name in term.plotted[:2] if name != carrier) or ("speed",)


def carrier_of(term: AbstractTerm) -> str:
    """Driver that only gives an effect of two drivers its sign; empty if there is none."""
    carrier = "speed" if term.equation == "mechanical" else "current"
    plain = isinstance(term, AbstractTorque | AbstractVoltage)
    return carrier if plain and len(term.drivers) == 2 and carrier in term.drivers else ""


def column_of(term: AbstractTerm, found: Along) -> int:
    """Column of the equation in which an effect is plotted: 0 electrical, 1 mechanical."""
    if isinstance(term, AbstractTorque):
        return 1
    if isinstance(term, AbstractCoefficient) and term.coefficient in ("b", "J"):
        return 1
    if term.equation == "mechanical":
        return 1 if np.any(found.effects[term.name][0, :, 1]) else 0
    return 0
