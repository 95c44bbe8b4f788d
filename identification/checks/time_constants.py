"""Plausibility of the identified time constants, by data sheets of brushed motors.

    electrical   L / Ra            [s]
    mechanical   J Ra / Kt^2       [s]

Neither depends on the number of turns.  Data sheets of brushed motors up to the size of the
Faulhaber 3863 CR (200 W, Kt / sqrt(Ra) = 0.05 N m/sqrt(W)) give

    electrical   10 us (0816 SR), 25 us (1331 SR), 280 us (3863 CR), all coreless; 0.63 ms with an
                 iron core (Pittman 9232S003: 4.64 mH, 7.38 ohm)
    mechanical   6.1 to 6.5 ms, 6.3 to 7.1 ms, 4.8 ms and 14.4 ms

and those of printed armatures of 0.1 to 4.5 kW give below 0.15 ms and 2.9 to 20.5 ms.  Large servo
motors have electrical time constants of 8 to 40 ms (Parker MGV420B to MGV950C, of three phases; a
brushed motor with an iron core of that size is assumed to have the same).

The limits include these margins.  Electrical: a factor of eight for small motors, none for the
longest time constant of large ones.  Mechanical: a third of the shortest time constant, and ten
times the longest, which is a load of nine times the rotor inertia.

Source: data sheets of Faulhaber 0816 SR, 1331 SR and 3863 CR (May 2012), Pittman 9232S003, printed
armature motors B9M4 to BR27MACH, and the Parker MGV manual PVD3627 (August 2011), section 3.1.9.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from identification.checks.finding import Finding

__all__ = ["time_constant_findings"]

_SMALL: Final = 0.05
"""Largest motor constant Kt / sqrt(Ra) of a small motor [N m/sqrt(W)]."""
_ELECTRICAL_S: Final = (5e-3, 40e-3)
"""Longest electrical time constant of a small motor and of any motor [s]."""
_MECHANICAL_S: Final = (1e-3, 0.2)
"""Shortest and longest mechanical time constant [s]."""


def time_constant_findings(
    values: Mapping[str, float], trusted: Mapping[str, bool]
) -> list[Finding]:
    """Suspicions about time constants that motors of this size do not have.

    Parameters that are not trusted, because they are not determined or given by the user, are not
    checked.
    """
    resistance, constant = values["Ra25"], values["Kt25"]
    if not (resistance > 0.0 and constant > 0.0 and trusted["Ra25"] and trusted["Kt25"]):
        return []
    found = []
    is_small = constant <= _SMALL * resistance**0.5
    longest = _ELECTRICAL_S[0 if is_small else 1]
    if trusted["L"] and values["L"] / resistance > longest:
        found.append(_electrical(values["L"] / resistance, longest))
    mechanical = values["J"] * resistance / constant**2
    if trusted["J"] and not _MECHANICAL_S[0] <= mechanical <= _MECHANICAL_S[1]:
        found.append(_mechanical(mechanical))
    return found


def _electrical(time: float, longest: float) -> Finding:
    remedy = "measure L with an LCR meter and give --known L=VALUE"
    return Finding(
        "electrical_time_constant",
        "suspect",
        "",
        "current_A",
        f"L / Ra is {_text(time)}, expected at most {_text(longest)} for a motor of this size; "
        "possible causes: a filter or delay of the current sensor, a choke in the "
        f"leads, a wrong sample clock; {remedy}",
        "electrical time constant [s]",
        time,
        longest,
        separable=False,
        remedy=remedy,
        option="known",
    )


def _mechanical(time: float) -> Finding:
    remedy = "compare J with the data sheet and give --known J=VALUE"
    is_short = time < _MECHANICAL_S[0]
    why = (
        f"expected at least {_text(_MECHANICAL_S[0])} for a rotor without load; possible "
        "causes: a wrong unit, a wrong sample clock, a current that is not in A"
        if is_short
        else f"expected at most {_text(_MECHANICAL_S[1])}; possible causes: the inertia of a "
        "gear, flywheel or load, a wrong sample clock"
    )
    return Finding(
        "mechanical_time_constant",
        "suspect",
        "",
        "speed_rad_s",
        f"J Ra / Kt² is {_text(time)}, {why}; {remedy}",
        "mechanical time constant [s]",
        time,
        _MECHANICAL_S[0] if is_short else _MECHANICAL_S[1],
        separable=False,
        remedy=remedy,
        option="known",
    )


def _text(time: float) -> str:
    """Time in ms, or in s from one second on."""
    return f"{time:.3g} s" if time >= 1.0 else f"{1e3 * time:.3g} ms"
