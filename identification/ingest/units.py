"""Closed table of the units accepted in run files.

A general unit parser would be unsafe here: it reads ``Nm`` as a number times a metre, ``U/min`` as
enzyme units and ``C`` as coulomb, and the error shows only in a wrong parameter.  This table holds
the spellings used in motor logs, each for one quantity.  Any other spelling is an error that lists
the accepted ones.

Conversion to SI: ``value = (cell + shift) * factor``; only temperatures have a shift.  Spellings
are compared without spaces.  Words ("RPM", "Celsius") are case-insensitive.  Symbols are
case-sensitive: ``MA`` and ``MV`` would mean mega, so they are rejected and not read as milli.

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
    "FACTOR_QUANTITIES",
    "UNITS",
    "Unit",
    "accepted_spellings",
    "canonical_unit",
    "find_unit",
    "normalise_unit",
    "unit_in_another_case",
    "unit_since_1970",
]

CHANNEL_QUANTITIES = {
    "time_s": "time",
    "voltage_V": "voltage",
    "current_A": "current",
    "speed_rad_s": "speed",
    "temperature_degC": "temperature",
    "position_rad": "angle",
}

FACTOR_QUANTITIES = {"duty": "duty", "bus_voltage_V": "bus voltage"}
"""Columns whose product is the voltage where no motor voltage is logged."""


@dataclass(frozen=True)
class Unit:
    """One accepted unit: ``value in SI = (cell + shift) * factor``."""

    name: str
    """Spelling used in messages and mappings."""
    quantity: str
    """Physical quantity, one of the values of `CHANNEL_QUANTITIES`, or ``duty``."""
    factor: float = 1.0
    """SI units per unit."""
    shift: float = 0.0
    """Offset added to the cell before the factor [this unit]."""
    symbols: str = ""
    """Case-sensitive spellings, separated by blanks."""
    words: str = ""
    """Case-insensitive spellings, in lower case, separated by blanks."""

    @property
    def spellings(self) -> tuple[str, ...]:
        """All accepted spellings; `name` comes first."""
        return tuple(dict.fromkeys((self.name, *self.symbols.split(), *self.words.split())))


_TURN = 2.0 * math.pi

UNITS = (
    Unit("s", "time", symbols="S", words="sec secs second seconds"),
    Unit("ms", "time", 1e-3, words="msec millisecond milliseconds millis"),
    Unit("us", "time", 1e-6, symbols="µs", words="usec microsecond microseconds micros"),
    Unit("ns", "time", 1e-9, words="nanosecond nanoseconds nanosec nsec nsecs"),
    Unit("min", "time", 60.0, words="minute minutes"),
    # Spreadsheets count days.
    Unit("days", "time", 86400.0, words="day"),
    # Not ADC: that is as often a count of an analogue-digital converter as amperes of DC.
    Unit("V", "voltage", symbols="v VDC Vdc", words="volt volts"),
    Unit("mV", "voltage", 1e-3, symbols="mv mVDC", words="millivolt millivolts"),
    Unit("kV", "voltage", 1e3, words="kilovolt kilovolts"),
    Unit("A", "current", symbols="a", words="amp amps ampere amperes"),
    Unit("mA", "current", 1e-3, symbols="ma", words="milliamp milliamps milliampere milliamperes"),
    Unit("uA", "current", 1e-6, symbols="µA", words="microamp microamps"),
    Unit("kA", "current", 1e3),
    Unit(
        "rad/s",
        "speed",
        symbols="rad_s rad_per_s rads-1 rad.s-1",
        words="rad/sec radian/s radians/s",
    ),
    Unit(
        "deg/s",
        "speed",
        _TURN / 360.0,
        symbols="°/s deg_s deg_per_s",
        words="deg/sec degree/s degrees/s",
    ),
    Unit("rev/s", "speed", _TURN, symbols="rev_s", words="rps turn/s turns/s"),
    Unit("rpm", "speed", _TURN / 60.0, symbols="1/min min-1", words="r/min rev/min u/min tr/min"),
    Unit("krpm", "speed", _TURN / 60.0 * 1e3),
    Unit("degC", "temperature", symbols="°C C deg_C", words="celsius degc"),
    Unit("degF", "temperature", 5.0 / 9.0, -32.0, symbols="°F F deg_F", words="fahrenheit degf"),
    Unit("K", "temperature", 1.0, -273.15, words="kelvin degk"),
    Unit("rad", "angle", words="radian radians"),
    Unit("mrad", "angle", 1e-3),
    Unit("deg", "angle", _TURN / 360.0, symbols="°", words="degree degrees"),
    Unit("rev", "angle", _TURN, words="turn turns revolution revolutions"),
    Unit("ratio", "duty", words="fraction pu p.u."),
    Unit("%", "duty", 1e-2, words="percent pct"),
)
"""All accepted units; docs/run-files.md prints them and a test keeps both equal."""


def normalise_unit(text: str) -> str:
    """Normalise the text of a unit for comparison with the table.

    Compatibility characters are unified (``℃``, ``µ`` as sign or Greek letter, superscript minus
    one), spaces and carets are dropped, and product signs become full stops.  A text longer than
    any spelling returns empty, because Unicode normalisation sorts combining characters in
    quadratic time.
    """
    text = "".join(text.split())
    if len(text) > _LONGEST:
        return ""
    # Spanish keyboards type the ordinal sign for a degree; NFKC would turn it into the letter o.
    text = unicodedata.normalize("NFKC", text.replace("º", "°"))
    text = text.replace("\u2212", "-").replace("^", "").replace("·", ".").replace("*", ".")
    return "".join(text.split())


_LONGEST = 40
_EXACT = {normalise_unit(s): unit for unit in UNITS for s in (unit.name, *unit.symbols.split())}
_ANY_CASE = {normalise_unit(word).casefold(): unit for unit in UNITS for word in unit.words.split()}
_OTHER_CASE = {name.casefold(): unit for name, unit in reversed(_EXACT.items())}
# These symbols are unambiguous in any case.
_ANY_CASE |= {name: _EXACT[name] for name in ("rpm", "krpm", "rad/s", "rev/s", "deg/s", "rad")}


def find_unit(text: str) -> Unit | None:
    """Unit of a spelling, or None if the table does not contain it."""
    key = normalise_unit(text)
    return _EXACT.get(key) or _ANY_CASE.get(key.casefold())


def unit_in_another_case(text: str) -> Unit | None:
    """Unit whose spelling differs from the text only in case, such as mA for ``MA``."""
    return _OTHER_CASE.get(normalise_unit(text).casefold())


def unit_since_1970(number: float) -> str:
    """Name of the unit in which a time since 1970 is one of the years 2000 to 2099; else blank."""
    first, last = _YEARS_2000_TO_2099
    times = (unit for unit in UNITS if unit.quantity == "time" and unit.factor <= 1.0)
    return next((unit.name for unit in times if first <= number * unit.factor < last), "")


_YEARS_2000_TO_2099 = (946_684_800.0, 4_102_444_800.0)


def canonical_unit(channel: str) -> Unit:
    """SI unit of a channel of `CHANNEL_UNITS`, or of a factor of the voltage."""
    units = CHANNEL_UNITS | {"duty": "ratio", "bus_voltage_V": "V"}
    return _EXACT[normalise_unit(units[channel])]


def accepted_spellings(quantity: str) -> str:
    """Unit names of one quantity for a message, such as ``s, ms, us, ns, min``."""
    return ", ".join(unit.name for unit in UNITS if unit.quantity == quantity)
