"""Units that a run file may be written in: a closed table, and nothing outside it.

A general unit parser is the obvious choice and the wrong one here: it reads ``Nm`` as a number
times a metre, ``U/min`` as enzyme units and ``C`` as coulomb, and none of that is seen until a
parameter comes out wrong.  This table knows the spellings that motor logs use, each for one
quantity, and everything else is an error that lists what is accepted.

A unit turns a cell into SI by ``value = (cell + shift) * factor``; only temperatures shift.
Spellings are compared without spaces.  Words ("RPM", "Celsius") may have any case, symbols not:
``MA`` and ``MV`` would be mega, so they are refused instead of read as milli.

    find_unit("U/min").factor      ->  0.10471975511965977
    find_unit("oz-in")             ->  None
"""

from __future__ import annotations

import math
import unicodedata
from dataclasses import dataclass

from identification.quantities import CHANNEL_UNITS

__all__ = [
    "CHANNEL_QUANTITIES",
    "UNITS",
    "Unit",
    "accepted_spellings",
    "canonical_unit",
    "find_unit",
    "normalise_unit",
    "unit_in_another_case",
]

CHANNEL_QUANTITIES = {
    "time_s": "time",
    "voltage_V": "voltage",
    "current_A": "current",
    "speed_rad_s": "speed",
    "temperature_degC": "temperature",
    "position_rad": "angle",
}


@dataclass(frozen=True)
class Unit:
    """One accepted unit: ``value in SI = (cell + shift) * factor``.

    Args:
        name: The spelling used in messages and in mappings.
        quantity: What it measures, one of the values of `CHANNEL_QUANTITIES`.
        factor: SI units per unit.
        shift: What is added to the cell before the factor, in the unit itself.
        symbols: Spellings whose case matters.
        words: Spellings in lower case that are accepted in any case.
    """

    name: str
    quantity: str
    factor: float = 1.0
    shift: float = 0.0
    symbols: tuple[str, ...] = ()
    words: tuple[str, ...] = ()

    @property
    def spellings(self) -> tuple[str, ...]:
        """All accepted spellings, the name first."""
        return tuple(dict.fromkeys((self.name, *self.symbols, *self.words)))


_TURN = 2.0 * math.pi

UNITS = (
    Unit("s", "time", words=("sec", "secs", "second", "seconds")),
    Unit("ms", "time", 1e-3, words=("msec", "millisecond", "milliseconds")),
    Unit("us", "time", 1e-6, symbols=("µs",), words=("usec", "microsecond", "microseconds")),
    Unit("ns", "time", 1e-9, words=("nanosecond", "nanoseconds")),
    Unit("min", "time", 60.0, words=("minute", "minutes")),
    Unit("V", "voltage", symbols=("v",), words=("volt", "volts")),
    Unit("mV", "voltage", 1e-3, symbols=("mv",), words=("millivolt", "millivolts")),
    Unit("kV", "voltage", 1e3, words=("kilovolt", "kilovolts")),
    Unit("A", "current", symbols=("a",), words=("amp", "amps", "ampere", "amperes")),
    Unit(
        "mA",
        "current",
        1e-3,
        symbols=("ma",),
        words=("milliamp", "milliamps", "milliampere", "milliamperes"),
    ),
    Unit("uA", "current", 1e-6, symbols=("µA",), words=("microamp", "microamps")),
    Unit("kA", "current", 1e3),
    Unit(
        "rad/s",
        "speed",
        symbols=("rad_s", "rad_per_s", "rads-1", "rad.s-1"),
        words=("rad/sec",),
    ),
    Unit("deg/s", "speed", _TURN / 360.0, symbols=("°/s", "deg_s", "deg_per_s")),
    Unit("rev/s", "speed", _TURN, symbols=("rev_s",), words=("rps",)),
    Unit(
        "rpm",
        "speed",
        _TURN / 60.0,
        symbols=("1/min", "min-1"),
        words=("r/min", "rev/min", "u/min", "tr/min"),
    ),
    Unit("krpm", "speed", _TURN / 60.0 * 1e3),
    Unit("degC", "temperature", symbols=("°C", "C", "deg_C"), words=("celsius", "degc")),
    Unit(
        "degF",
        "temperature",
        5.0 / 9.0,
        -32.0,
        symbols=("°F", "F", "deg_F"),
        words=("fahrenheit", "degf"),
    ),
    Unit("K", "temperature", 1.0, -273.15, words=("kelvin", "degk")),
    Unit("rad", "angle", words=("radian", "radians")),
    Unit("mrad", "angle", 1e-3),
    Unit("deg", "angle", _TURN / 360.0, symbols=("°",), words=("degree", "degrees")),
    Unit("rev", "angle", _TURN, words=("turn", "turns", "revolution", "revolutions")),
)
"""The whole table; docs/run-files.md prints it and a test keeps the two equal."""


def normalise_unit(text: str) -> str:
    """Bring a unit's text to the form in which the table is compared.

    Compatibility characters are unified (``℃``, ``µ`` as sign or Greek letter, superscript
    minus one), spaces and carets dropped, and every product sign made a full stop.  A text that is
    longer than any spelling comes out empty: Unicode sorts combining characters in quadratic time.
    """
    text = "".join(text.split())
    if len(text) > _LONGEST:
        return ""
    # The ordinal sign is what a Spanish keyboard gives for a degree; NFKC would make it an o.
    text = unicodedata.normalize("NFKC", text.replace("º", "°"))
    text = text.replace("\u2212", "-").replace("^", "").replace("·", ".").replace("*", ".")
    return "".join(text.split())


_LONGEST = 40
_EXACT = {normalise_unit(s): unit for unit in UNITS for s in (unit.name, *unit.symbols)}
_ANY_CASE = {normalise_unit(word).casefold(): unit for unit in UNITS for word in unit.words}
# Names with more than one letter after the prefix, such as rpm or rad/s, are words as well.
_OTHER_CASE = {name.casefold(): unit for name, unit in reversed(_EXACT.items())}
_ANY_CASE |= {name: _EXACT[name] for name in ("rpm", "krpm", "rad/s", "rev/s", "deg/s", "rad")}


def find_unit(text: str) -> Unit | None:
    """Look a spelling up in the table; None where it is not there."""
    key = normalise_unit(text)
    return _EXACT.get(key) or _ANY_CASE.get(key.casefold())


def unit_in_another_case(text: str) -> Unit | None:
    """Look up the unit that the text would be in another case, such as mA for ``MA``."""
    return _OTHER_CASE.get(normalise_unit(text).casefold())


def canonical_unit(channel: str) -> Unit:
    """Give the SI unit of a channel of `CHANNEL_UNITS`."""
    return _EXACT[normalise_unit(CHANNEL_UNITS[channel])]


def accepted_spellings(quantity: str) -> str:
    """List the unit names of one quantity for a message, such as ``s, ms, us, ns, min``."""
    return ", ".join(unit.name for unit in UNITS if unit.quantity == quantity)
