"""Priors of motor parameters from nameplate or catalogue data.

With voltage V, no-load speed w0 and current I0, stall current Is and torque Ts, and a rated point
(wr, Ir, Tr) at the same voltage, the steady state of the two balances gives

    Ra = V / Is                          or   Kt (w0 - wr) / (Ir - I0)
    Kt = (V - Ra I0) / w0                or   Ts / (Is - I0),  Tr / (Ir - I0)
    b <= Kt I0 / w0                      all no-load losses taken as viscous friction

The spreads are rules of thumb, not from a standard.  A stalled winding is hot and its brushes are
worn or new, so Ra has a spread of 20 %; magnets and rounded data give Kt one of 10 %.  Dry friction
is an unknown part of the losses, so their total only bounds b.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from identification.errors import OptionError
from identification.known import NUMBER, Prior

__all__ = ["KEYS", "NAMEPLATE", "Nameplate", "nameplate_of"]

NAMEPLATE: Final = "--nameplate"
"""Origin of a prior that was derived from a nameplate."""

_RESISTANCE_SPREAD: Final = 0.2
_CONSTANT_SPREAD: Final = 0.1

_APART: Final = 2.0
"""Ratio of torque constants from two equations above which a nameplate contradicts itself."""

_RPM: Final = math.pi / 30.0
_UNITS: Final[dict[str, dict[str, float]]] = {
    "V": {"V": 1.0, "mV": 1e-3},
    "A": {"A": 1.0, "mA": 1e-3},
    "rad/s": {"rad/s": 1.0, "rpm": _RPM},
    "N m": {"Nm": 1.0, "mNm": 1e-3},
}
"""Accepted units after a number, with their factors, by SI unit; a bare number is in the SI
unit."""

KEYS: Final = {
    "voltage": "V",
    "no_load_speed": "rad/s",
    "no_load_current": "A",
    "stall_current": "A",
    "stall_torque": "N m",
    "rated_speed": "rad/s",
    "rated_current": "A",
    "rated_torque": "N m",
}
"""SI unit of each nameplate key."""

_VALUE: Final = re.compile(rf"\s*({NUMBER})\s*([A-Za-z/ ]*?)\s*")
_LARGEST: Final = 1e9
_SMALLEST: Final = 1e-9
_EXAMPLE: Final = "voltage=12,no_load_speed=3000rpm,no_load_current=0.1,stall_current=4.2"


@dataclass(frozen=True)
class Nameplate:
    """Parameters derived from a nameplate, in SI units."""

    resistance: float | None = None
    """Armature resistance [ohm]; None if the data do not determine it."""
    constant: float | None = None
    """Torque and back-EMF constant [N m/A]; None if the data do not determine it."""
    friction: float | None = None
    """Upper bound of the viscous friction [N m s/rad]; None if the data give none."""
    voltage: float | None = None
    """Voltage of the data [V]; None if not given."""

    @property
    def priors(self) -> tuple[Prior, ...]:
        """Priors of the parameters that the data determine."""
        said = (
            ("Ra25", self.resistance, _RESISTANCE_SPREAD),
            ("Kt25", self.constant, _CONSTANT_SPREAD),
        )
        return tuple(
            Prior(name, value, spread * value, NAMEPLATE)
            for name, value, spread in said
            if value is not None
        )


def nameplate_of(text: str) -> Nameplate:
    """Derive parameters from ``KEY=VALUE,...``; none if the text is empty.

    Args:
        text: Data separated by commas or semicolons, in SI units or with a unit after the number.

    Raises:
        OptionError: A key is unknown or given twice, a value is not a positive number in a valid
            unit, the data contradict each other, or they determine neither Ra25 nor Kt25.
    """
    if not text.strip():
        return Nameplate()
    data = _data(text)
    _check(text, data)
    found = _derived(data)
    if found.resistance is None and found.constant is None:
        raise _refusal(
            text,
            f"determines neither Ra25 nor Kt25; expected for example {_EXAMPLE}, or at least "
            "voltage with no_load_speed or stall_current",
        )
    _check_constants(text, data, found)
    for prior in found.priors:
        if not _SMALLEST <= prior.value <= _LARGEST:
            raise _refusal(
                text,
                f"gives {prior.name} {prior.value:.3g} {prior.unit}; expected {_SMALLEST:g} to "
                f"{_LARGEST:g} {prior.unit}; check the units",
            )
    return found


def _data(text: str) -> dict[str, float]:
    data: dict[str, float] = {}
    for part in filter(None, (part.strip() for part in re.split("[,;]", text))):
        key, equals, word = (piece.strip() for piece in part.partition("="))
        if not equals or key not in KEYS:
            raise _refusal(
                part, f"expected KEY=VALUE with a key of {', '.join(KEYS)} and a decimal point"
            )
        if key in data:
            raise _refusal(part, f"{key} is given twice; keep one")
        data[key] = _value(part, word, KEYS[key])
    return data


def _value(part: str, word: str, unit: str) -> float:
    """The number in SI units."""
    units, match = _UNITS[unit], _VALUE.fullmatch(word)
    suffix = match[2].replace(" ", "") if match else ""
    if match is None or (suffix and suffix not in units):
        raise _refusal(
            part, f"expected a number in {unit}, or one with the unit {', '.join(units)}"
        )
    value = float(match[1]) * units.get(suffix, 1.0)
    if not _SMALLEST <= value <= _LARGEST:
        raise _refusal(part, f"is {value:g} {unit}; expected {_SMALLEST:g} to {_LARGEST:g} {unit}")
    return value


def _check(text: str, data: Mapping[str, float]) -> None:
    """Reject contradictory data: under load, a motor draws more current and turns slower."""
    orders = (
        ("no_load_current", "rated_current"),
        ("no_load_current", "stall_current"),
        ("rated_current", "stall_current"),
        ("rated_speed", "no_load_speed"),
        ("rated_torque", "stall_torque"),
    )
    for less, more in orders:
        if less in data and more in data and not data[less] < data[more]:
            raise _refusal(
                text,
                f"{less} is {data[less]:g} {KEYS[less]} and {more} is {data[more]:g} {KEYS[more]}; "
                f"expected {less} below {more}; check the units",
            )


def _check_constants(text: str, data: Mapping[str, float], found: Nameplate) -> None:
    """Reject a torque constant from the speed that differs from the one from a torque.

    The rated torque is used only if the no-load current is known, since that is a large part of the
    rated current of a small motor.
    """
    if found.constant is None:
        return
    idle = data.get("no_load_current")
    for point, least in (("stall", 0.0 if idle is None else idle), ("rated", idle)):
        torque, current = data.get(f"{point}_torque"), data.get(f"{point}_current")
        if torque is None or current is None or least is None:
            continue
        ratio = torque / (current - least) / found.constant
        if not 1.0 / _APART < ratio < _APART:
            raise _refusal(
                text,
                f"the torque constant from the {point} torque is {ratio:.3g} times that from the "
                f"no-load speed; expected {1.0 / _APART:g} to {_APART:g}; check the units (append "
                "rpm to a speed in rpm and mNm to a torque in mN m)",
            )


def _derived(data: Mapping[str, float]) -> Nameplate:
    """Parameters of the steady state, each from the first equation whose data are complete."""
    voltage, free = data.get("voltage"), data.get("no_load_speed")
    idle = data.get("no_load_current", 0.0)
    stall, rated = data.get("stall_current"), data.get("rated_current")
    resistance = voltage / stall if voltage and stall else None
    constant: float | None = None
    if voltage and free:
        slow = data.get("rated_speed")
        if resistance is not None:
            constant = (voltage - resistance * idle) / free
        elif rated and slow:
            constant = voltage * (rated - idle) / (free * rated - slow * idle)
            resistance = constant * (free - slow) / (rated - idle)
        else:
            constant = voltage / free
    elif stall and "stall_torque" in data:
        constant = data["stall_torque"] / (stall - idle)
    elif rated and "rated_torque" in data:
        constant = data["rated_torque"] / (rated - idle)
    friction = constant * idle / free if constant and idle and free else None
    return Nameplate(resistance, constant, friction, voltage)


def _refusal(part: str, message: str) -> OptionError:
    return OptionError(f"nameplate {part[:120]!r}: {message}", value=part)
