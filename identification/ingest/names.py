"""Column header parser: physical quantity and unit of one header cell.

The first matching form is used:

    time_s                         canonical name, case-insensitive
    rpm, volts, [s], in s          a unit alone, of at least two characters
    speed [rpm], Strom (mA)        a unit in brackets
    speed in rpm; speed, rpm       a unit after ``in`` or a comma
    motor_speed_rpm, tempDegC      a unit suffix
    t/ms                           a unit after a slash

The name in front of the unit must be one of `NAMES`, apart from neutral words (``motor``,
``measured``), also as one word with a part of the motor (``Ankerstrom``, ``motorspeed``).  A header
such as ``1st motor speed`` is never assigned automatically; the message that asks for a mapping
lists it as similar.  Setpoints (``set speed``) are not listed.  A name may stand for two quantities
(``t``, ``theta``); then the unit decides.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from identification.ingest.units import (
    CHANNEL_QUANTITIES,
    canonical_unit,
    find_unit,
    unit_in_another_case,
)

__all__ = [
    "COMPOUND_PARTS",
    "LONGEST_CELL",
    "NAMES",
    "HeaderText",
    "is_channel_name",
    "is_direction",
    "is_sample_number",
    "is_setpoint",
    "is_shunt",
    "is_supply",
    "is_units_row",
    "read_header",
    "similar_to",
]

_NAME_LISTS = {
    "time": "time, t, timestamp, timestamps, time stamp, elapsed time, relative time, "
    "time relative, tout, x axis, header stamp, date time, zeit, uhrzeit, zeitstempel, temps, "
    "tempo, tiempo",
    "voltage": "voltage, v, u, vm, um, va, ua, vmot, umot, spannung, tensão, tensao, tensión, "
    "tensione, voltaje, voltagem",
    "current": "current, curr, i, im, ia, imot, strom, courant, corrente, corriente",
    "speed": "speed, velocity, vel, omega, ω, w, n, angular velocity, angular speed, "
    "rotational speed, rpm, drehzahl, winkelgeschwindigkeit, drehgeschwindigkeit, vitesse, "
    "vitesse angulaire, velocidade, velocidade angular, velocidad, velocidad angular, velocità",
    "temperature": "temperature, temp, t, theta, ϑ, temperatur, température, temperatura",
    "angle": "position, pos, angle, theta, phi, φ, θ, encoder position, encoder angle, winkel, "
    "drehwinkel, geberwinkel, rotorlage, wellenlage",
    "duty": "duty, duty cycle, dutycycle, duty ratio, pwm, pwm duty, pwm duty cycle, tastgrad, "
    "tastverhältnis, aussteuerung",
    "bus voltage": "bus voltage, v bus, u bus, link voltage, supply voltage, "
    "power supply voltage, battery voltage, input voltage, vbus, ubus, vdc, udc, vbat, ubat, "
    "vsupply, zwischenkreisspannung, versorgungsspannung, batteriespannung",
}
NAMES = {quantity: tuple(names.split(", ")) for quantity, names in _NAME_LISTS.items()}
"""Accepted names of each quantity, in lower case; docs/run-files.md prints them."""

NEUTRAL_WORDS = frozenset(
    "motor mot dc armature terminal winding shaft rotor sensor measured meas actual act ist "
    "anker klemmen wicklungs wellen läufer laeufer gemessen gemessene istwert "
    "value average avg ave mean last".split()
)
# Parts of the motor that are written together with a name of at least four letters:
# Klemmenspannung, Ankerstrom, motorspeed.  A supply or a set point is not among them.
COMPOUND_PARTS = tuple(
    "klemmen anker motor wicklungs wicklung wellen läufer laeufer rotor ist "
    "armature terminal winding shaft".split()
)
_SHORTEST_IN_COMPOUND = 4
_SETPOINT_WORDS = frozenset(
    "set setpoint target ref reference command cmd demand desired soll error limit max min".split()
)

_QUANTITIES: dict[str, frozenset[str]] = {}
for _quantity, _names in NAMES.items():
    for _name in map(str.casefold, _names):
        _QUANTITIES[_name] = _QUANTITIES.get(_name, frozenset()) | {_quantity}

LONGEST_CELL = 1000
"""Longest accepted header cell [characters]; a longer one is rejected with its row and column."""

_CANONICAL = {name.casefold(): name for name in CHANNEL_QUANTITIES}
# VESC Tool: milliseconds since midnight.
_DEVICES = {"ms_today": "time_ms"}
_OPENING, _CLOSING = "[({<", "])}>"
# Neither pattern can match in two ways from one start position: matching time is linear.
_BOUNDARY = re.compile(r"[\s_.\-]+|(?<=[a-z])(?=[A-Z°])")
_WORD = re.compile(r"[^\W\d_]+|\d+")


@dataclass(frozen=True)
class HeaderText:
    """Parsed header cell."""

    quantities: frozenset[str] = frozenset()
    """Quantities that the name may stand for; empty if the name is unknown."""
    unit_text: str | None = None
    """Unit as written, or None if there is none."""
    canonical: str | None = None
    """Canonical channel name if the header is exactly that name."""


def read_header(text: str) -> HeaderText:
    """Parse one header cell in time proportional to its length.

    A cell longer than `LONGEST_CELL` yields an empty result.
    """
    if len(text) > LONGEST_CELL:
        return HeaderText()
    text = " ".join(text.strip().strip("'").split())
    text = _DEVICES.get(text.casefold(), text)
    channel = _CANONICAL.get(text.casefold())
    if channel is not None:
        quantity = frozenset({CHANNEL_QUANTITIES[channel]})
        return HeaderText(quantity, canonical_unit(channel).name, channel)
    whole = find_unit(unbracketed(text).removeprefix("in "))
    # A single letter is as often a name as a unit: V, A, s, t, i.  Those need a mapping.
    # Vdc alone is the name of a bus voltage.
    named = {whole.quantity} if whole is not None else frozenset()
    named = _QUANTITIES.get(text.casefold(), named)
    if whole is not None and len(text) > 1 and whole.quantity != "duty" and whole.quantity in named:
        return HeaderText(frozenset({whole.quantity}), whole.name)
    for form in (_in_brackets, _after_word, _as_suffix, _after_slash):
        found = form(text)
        if found is not None:
            return found
    return HeaderText(_quantities_of(text))


def is_channel_name(text: str) -> bool:
    """Return True if a header cell names one of the quantities of a run."""
    return bool(read_header(text).quantities)


def is_units_row(cells: list[str] | tuple[str, ...]) -> bool:
    """Return True if at least half of the filled cells of a header row are units."""
    filled = [cell for cell in cells if cell]
    units = sum(1 for cell in filled if find_unit(unbracketed(cell)) is not None)
    return bool(filled) and units * 2 >= len(filled)


def unbracketed(cell: str) -> str:
    """Unit without its brackets: ``[s]`` gives ``s``."""
    parts = _cut_at_brackets(" ".join(cell.split()))
    return parts[1] if parts is not None and not parts[0] else cell


def is_sample_number(text: str) -> bool:
    """Return True for a name of a sample counter, which is a time but for the interval."""
    words = [word for word in _words(text[:LONGEST_CELL]) if word not in ("number", "nr", "no")]
    return len(words) == 1 and words[0] in _COUNTERS


def is_direction(text: str) -> bool:
    """Return True for a name without unit of a column that may give the direction of rotation."""
    header = read_header(text)
    is_free = not header.quantities and header.unit_text is None
    return is_free and bool(_DIRECTIONS.intersection(_words(text[:LONGEST_CELL])))


_DIRECTIONS = frozenset(
    "dir direction sense sign polarity fwd forward rev reverse cw ccw richtung drehrichtung "
    "laufrichtung vorzeichen".split()
)
_COUNTERS = frozenset("sample samples index idx row tick ticks step cycle cycles".split())
_SUPPLIES = frozenset(
    "supply bus link battery batt bat pack vbus vbat vdc vin ubus ubat udc uin".split()
)


def is_shunt(text: str) -> bool:
    """Return True for the name of a voltage across a shunt, which measures the current."""
    return "shunt" in _words(text[:LONGEST_CELL])


def is_supply(text: str) -> bool:
    """Return True for the name of the voltage of a supply, which a chopper may switch."""
    words = _words(text[:LONGEST_CELL])
    return bool(_SUPPLIES.intersection(words)) or "bus voltage" in read_header(text).quantities


def is_setpoint(text: str) -> bool:
    """Return True for setpoints and limits, so that no message suggests to fit a command."""
    name = (_cut_at_brackets(" ".join(text[:LONGEST_CELL].split())) or ("",))[0] or text
    words = _words(name[:LONGEST_CELL])
    return bool(_SETPOINT_WORDS.intersection(words)) or any(w.startswith("set") for w in words)


def similar_to(text: str, quantity: str) -> bool:
    """Return True if a header without an accepted name resembles one of this quantity.

    Setpoints are excluded; a duty cycle is always a command.
    """
    if quantity != "duty" and is_setpoint(text):
        return False
    words = _words(text[:LONGEST_CELL])
    # Abbreviations used by loggers: m1cur, mot_vel.
    starts = [name for name in NAMES[quantity] if len(name) > 2] + _STEMS.get(quantity, [])
    starts += [part + start for part in COMPOUND_PARTS for start in starts]
    fragments = _FRAGMENTS.get(quantity, ())
    return any(word.startswith(tuple(starts)) for word in words) or any(
        part in word for part in fragments for word in words
    )


# Three letters within a word are those of another one: sample, timestamp, accuracy, level.
# ODrive: Iq_measured, the current of the torque.
_STEMS = {"current": ["cur", "amps", "amper", "iq"]}
_FRAGMENTS = {
    "voltage": ("volt",),
    "current": ("current",),
    "speed": ("speed", "rpm"),
    "temperature": ("temp",),
    "angle": ("angle", "encoder", "count", "geber", "winkel", "inkrement"),
}


def _in_brackets(text: str) -> HeaderText | None:
    parts = _cut_at_brackets(text)
    return None if parts is None or not parts[0] else _with_unit(*parts)


def _cut_at_brackets(text: str) -> tuple[str, str] | None:
    """Name and unit of ``speed [rpm]`` or ``n (1/(min))``; None for any other form.

    The text has no two blanks in a row.
    """
    if text[-1:] not in tuple(_CLOSING):
        return None
    inner = text[:-1].rstrip()
    # The unit may itself end with a parenthesis.
    end = max(inner.rfind("("), 0) if inner.endswith(")") else len(inner)
    opening = max(inner.rfind(bracket, 0, end) for bracket in _OPENING)
    is_open = not any(bracket in inner[opening + 1 : end] for bracket in _CLOSING)
    if opening < 0 or not is_open or ")" in inner[end:-1]:
        return None
    return inner[:opening].rstrip(" _"), inner[opening + 1 :].strip()


def _after_word(text: str) -> HeaderText | None:
    for sign in (" in ", ","):
        # The name has at least one character.
        at = text.find(sign, 1)
        name, unit = text[:at], text[at + len(sign) :]
        if at > 0 and unit:
            return _with_unit(name, unit)
    return None


def _as_suffix(text: str) -> HeaderText | None:
    """Longest suffix that is a unit, after a prefix that is an accepted name.

    A suffix that is a unit only in another case is kept, so that the error can name it.
    """
    wrong_case: HeaderText | None = None
    for boundary in _BOUNDARY.finditer(text):
        name, unit = text[: boundary.start()], text[boundary.end() :]
        # Test the unit first: few suffixes are units, and a name costs time linear in its length.
        if find_unit(unit) is not None and _quantities_of(name):
            return _with_unit(name, unit)
        if wrong_case is None and unit_in_another_case(unit) is not None and _quantities_of(name):
            wrong_case = _with_unit(name, unit)
    return wrong_case


def _after_slash(text: str) -> HeaderText | None:
    name, stroke, unit = text.rpartition(" / ")
    if stroke and find_unit(unit) is not None:
        return _with_unit(name, unit)
    name, stroke, unit = text.partition("/")
    if not stroke or not _quantities_of(name):
        return None
    return _with_unit(name, unit.strip().strip("()"))


def _with_unit(name: str, unit_text: str) -> HeaderText | None:
    """Combine a name and a unit; the unit resolves a name with several quantities."""
    unit_text = unit_text.strip()
    unit = find_unit(unit_text)
    quantities = _quantities_of(name)
    if unit is not None and unit.quantity in quantities:
        quantities = frozenset({unit.quantity})
    return HeaderText(quantities, unit_text or None)


def _quantities_of(text: str) -> frozenset[str]:
    words = _words(text)
    short = [word for word in words if word not in NEUTRAL_WORDS]
    parted = [_without_part(word) for word in short]
    for candidate in (words, short, parted):
        found = _QUANTITIES.get(" ".join(candidate))
        if found:
            return found
    return frozenset()


def _without_part(word: str) -> str:
    """Name at the end of a compound word, such as ``strom`` of ``ankerstrom``."""
    for part in COMPOUND_PARTS:
        name = word.removeprefix(part)
        if name != word and len(name) >= _SHORTEST_IN_COMPOUND and name in _QUANTITIES:
            return name
    return word


def _words(text: str) -> list[str]:
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return [word.casefold() for word in _WORD.findall(spaced)]
