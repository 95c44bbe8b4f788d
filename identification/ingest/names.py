"""What the header of one column says: which quantity, in which unit.

A header is read in these forms, the first that fits:

    time_s                     a canonical name, exact, in any case
    rpm, volts                 a unit alone, where it is a word
    speed [rpm], Strom (mA)    a unit in brackets
    speed in rpm, t/ms         a unit after ``in`` or a stroke
    motor_speed_rpm, tempDegC  a unit at the end

The name in front of the unit has to be one of the names below, apart from words that change
nothing (``motor``, ``measured``).  ``set speed`` or ``1st motor speed`` are no such names: they
are kept as similar, for the message that asks for a mapping, and never used by themselves.  A
name may stand for two quantities (``t``, ``theta``); then the unit decides.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from identification.ingest.units import (
    CHANNEL_QUANTITIES,
    Unit,
    canonical_unit,
    find_unit,
    unit_in_another_case,
)

__all__ = [
    "LONGEST_CELL",
    "NAMES",
    "HeaderText",
    "is_channel_name",
    "is_units_row",
    "read_header",
    "similar_to",
]

NAMES = {
    "time": ("time", "t", "timestamp", "time stamp", "elapsed time", "zeit"),
    "voltage": ("voltage", "v", "u", "vm", "um", "va", "ua", "vmot", "spannung"),
    "current": ("current", "i", "im", "ia", "imot", "strom"),
    "speed": (
        "speed",
        "velocity",
        "vel",
        "omega",
        "ω",
        "w",
        "n",
        "angular velocity",
        "angular speed",
        "rotational speed",
        "rpm",
        "drehzahl",
        "winkelgeschwindigkeit",
    ),
    "temperature": ("temperature", "temp", "t", "theta", "ϑ", "temperatur"),
    "angle": ("position", "pos", "angle", "theta", "phi", "φ", "θ", "winkel"),
}
"""Names of each quantity, in lower case; docs/run-files.md prints them."""

NEUTRAL_WORDS = frozenset(
    "motor mot dc armature terminal winding shaft rotor sensor measured meas actual act ist".split()
)
_OTHER_SIGNAL = frozenset(
    "set setpoint target ref reference command cmd demand desired soll error limit max min".split()
)

_QUANTITIES: dict[str, frozenset[str]] = {}
for _quantity, _names in NAMES.items():
    for _name in map(str.casefold, _names):
        _QUANTITIES[_name] = _QUANTITIES.get(_name, frozenset()) | {_quantity}

LONGEST_CELL = 1000
"""Most characters of a header cell; a longer cell is refused with its row and column."""

_CANONICAL = {name.casefold(): name for name in CHANNEL_QUANTITIES}
_OPENING, _CLOSING = "[({<", "])}>"
# Neither pattern can begin a match at one character in two ways: the time is linear.
_BOUNDARY = re.compile(r"[\s_.\-]+|(?<=[a-z])(?=[A-Z°])")
_WORD = re.compile(r"[^\W\d_]+|\d+")


@dataclass(frozen=True)
class HeaderText:
    """What one header cell says.

    Args:
        quantities: What the name may stand for; empty where the name is none of ours.
        unit_text: The unit as written, or None where there is none.
        unit: That unit in the table, or None where it is not there.
        canonical: The canonical channel name, where the header is exactly that.
    """

    quantities: frozenset[str] = frozenset()
    unit_text: str | None = None
    unit: Unit | None = None
    canonical: str | None = None


def read_header(text: str) -> HeaderText:
    """Read one header cell, in a time proportional to its length.

    A cell of more than `LONGEST_CELL` characters says nothing.
    """
    if len(text) > LONGEST_CELL:
        return HeaderText()
    text = " ".join(text.strip().strip("'").split())
    channel = _CANONICAL.get(text.casefold())
    if channel is not None:
        quantity = frozenset({CHANNEL_QUANTITIES[channel]})
        unit = canonical_unit(channel)
        return HeaderText(quantity, unit.name, unit, channel)
    whole = find_unit(text)
    # A single letter is a name as often as a unit: V, A, s, t, i.  Those are asked about.
    if whole is not None and len(text) > 1:
        return HeaderText(frozenset({whole.quantity}), text, whole)
    for form in (_bracketed, _worded, _suffixed, _stroked):
        found = form(text)
        if found is not None:
            return found
    return HeaderText(_named(text))


def is_channel_name(text: str) -> bool:
    """Whether a header cell names one of the quantities of a run."""
    return bool(read_header(text).quantities)


def is_units_row(cells: list[str] | tuple[str, ...]) -> bool:
    """Whether a header row holds units under names: most of its filled cells are units."""
    filled = [cell for cell in cells if cell]
    units = sum(1 for cell in filled if find_unit(unbracketed(cell)) is not None)
    return bool(filled) and units * 2 >= len(filled)


def unbracketed(cell: str) -> str:
    """A cell of a units row without its brackets: ``[s]`` gives ``s``."""
    parts = _cut_at_brackets(" ".join(cell.split()))
    return parts[1] if parts is not None and not parts[0] else cell


def similar_to(text: str, quantity: str) -> bool:
    """Whether a header that is no exact name looks as if it were this quantity.

    Set points and limits are left out: nobody should be led to fit a command as a measurement.
    """
    words = _words(text[:LONGEST_CELL])
    if _OTHER_SIGNAL.intersection(words) or any(word.startswith("set") for word in words):
        return False
    wanted = [name for name in NAMES[quantity] if len(name) > 2]
    if any(word.startswith(name) for word in words for name in wanted):
        return True
    # Short names as loggers write them: m1cur, mot_vel.
    return any(part in word for word in words for part in _FRAGMENTS.get(quantity, ()))


_FRAGMENTS = {
    "voltage": ("volt",),
    "current": ("cur", "amp"),
    "speed": ("vel", "speed", "rpm"),
    "temperature": ("temp",),
    "angle": ("pos", "angle"),
}


def _bracketed(text: str) -> HeaderText | None:
    parts = _cut_at_brackets(text)
    return None if parts is None or not parts[0] else _with_unit(*parts)


def _cut_at_brackets(text: str) -> tuple[str, str] | None:
    """Name and unit of ``speed [rpm]`` or ``n (1/(min))``; None for another form.

    Args:
        text: Header text without two blanks in a row.
    """
    if text[-1:] not in tuple(_CLOSING):
        return None
    inner = text[:-1].rstrip()
    # The unit may end with parentheses of its own.
    end = max(inner.rfind("("), 0) if inner.endswith(")") else len(inner)
    opening = max(inner.rfind(bracket, 0, end) for bracket in _OPENING)
    is_open = not any(bracket in inner[opening + 1 : end] for bracket in _CLOSING)
    if opening < 0 or not is_open or ")" in inner[end:-1]:
        return None
    return inner[:opening].rstrip(" _"), inner[opening + 1 :].strip()


def _worded(text: str) -> HeaderText | None:
    for sign in (" in ", ","):
        # A name of at least one character stands in front.
        at = text.find(sign, 1)
        name, unit = text[:at], text[at + len(sign) :]
        if at > 0 and unit:
            return _with_unit(name, unit)
    return None


def _suffixed(text: str) -> HeaderText | None:
    """The longest ending that is a unit, behind a beginning that is a name.

    An ending that would be a unit in another case is kept as one, to be refused by name.
    """
    wrong_case: HeaderText | None = None
    for boundary in _BOUNDARY.finditer(text):
        name, unit = text[: boundary.start()], text[boundary.end() :]
        # The unit first: of all endings few are one, and a name takes the time of its length.
        if find_unit(unit) is not None and _named(name):
            return _with_unit(name, unit)
        if wrong_case is None and unit_in_another_case(unit) is not None and _named(name):
            wrong_case = _with_unit(name, unit)
    return wrong_case


def _stroked(text: str) -> HeaderText | None:
    name, stroke, unit = text.partition("/")
    if not stroke or not _named(name):
        return None
    return _with_unit(name, unit.strip().strip("()"))


def _with_unit(name: str, unit_text: str) -> HeaderText | None:
    """A name and a unit; where the name may be several quantities, the unit chooses."""
    unit_text = unit_text.strip()
    unit = find_unit(unit_text)
    quantities = _named(name)
    if unit is not None and unit.quantity in quantities:
        quantities = frozenset({unit.quantity})
    return HeaderText(quantities, unit_text or None, unit)


def _named(text: str) -> frozenset[str]:
    words = _words(text)
    short = [word for word in words if word not in NEUTRAL_WORDS]
    for candidate in (words, short):
        found = _QUANTITIES.get(" ".join(candidate))
        if found:
            return found
    return frozenset()


def _words(text: str) -> list[str]:
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return [word.casefold() for word in _WORD.findall(spaced)]
