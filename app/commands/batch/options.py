"""Parsing and validation of the fit options in a manifest.

Form of each option in a CSV cell:

seed            3
posterior       true, yes or 1; false, no or 0
effects         as posterior
hold            zoh
effort          quick
time_limit      60
temperatures    25;125
controllers     P:1;PI:2,0.5
set_aside       as posterior
force           as posterior
known           Kt25=0.048+-5%;L=2.9e-3
nameplate       voltage=12;no_load_speed=3000rpm

YAML uses its own booleans, numbers and lists; `nameplate` is a string in which commas
separate the entries.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

from identification.errors import InputError
from identification.numerals import decimal_of, whole_of
from identification.options import FitOptions

__all__ = ["option_of", "options_with"]

_TRUTH = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


class Place(Protocol):
    """Source location of an option value in a manifest."""

    def at(self, column: str) -> Place:
        """Return the same location with a column name."""

    def wrong(self, message: str) -> InputError:
        """Return an error for this location."""


def option_of(name: str, word: str, place: Place) -> object:
    """Parse the text of a CSV cell as the value of an option.

    Raises:
        InputError: The text is not a value of this option.
    """
    try:
        return _OF_WORD[name](word)
    except (ValueError, KeyError):
        raise place.wrong(f"{word[:60]!r} is not valid; expected {_EXPECTED[name]}") from None


def options_with(defaults: FitOptions, given: Mapping[Any, Any], place: Place) -> FitOptions:
    """Return the default options with the given values in place of some of them.

    Raises:
        InputError: An option is unknown, or a value is invalid.
    """
    values: dict[str, Any] = {}
    for name, value in given.items():
        if name not in _EXPECTED:
            raise place.wrong(
                f"has the unknown option {name!r}; expected one of {', '.join(_EXPECTED)}"
            )
        values[name] = _checked(name, value, place)
    try:
        options = replace(defaults, **values)
        if "controllers" in values:
            from identification.feedback.controller import parse_controllers

            parse_controllers(options.controllers)
    except InputError as error:
        raise place.wrong(error.message) from error
    return options


def _checked(name: str, value: object, place: Place) -> object:
    """Check the type of a value; convert lists to tuples, and integers to floats where needed."""
    expected = _EXPECTED[name]
    match name, value:
        case ("posterior" | "effects" | "set_aside" | "force", bool()) | (
            "hold" | "effort" | "nameplate",
            str(),
        ):
            return value
        case "time_limit", int() | float() if _is_number(value):
            return float(value)
        case "seed", int() if not isinstance(value, bool):
            return value
        case "temperatures", list() | tuple() if value and all(map(_is_number, value)):
            with contextlib.suppress(OverflowError):  # integer too large for a float
                return tuple(float(one) for one in value)
        case "controllers", list() | tuple() if value and all(isinstance(v, str) for v in value):
            return tuple(value)
        case "known", list() | tuple() if all(isinstance(v, str) for v in value):
            return tuple(value)
    raise place.at(name).wrong(f"{str(value)[:60]!r} is not valid; expected {expected}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _parts(word: str) -> Sequence[str]:
    return [part.strip() for part in word.split(";") if part.strip()]


_OF_WORD: dict[str, Callable[[str], object]] = {
    "seed": whole_of,
    "posterior": lambda word: _TRUTH[word.lower()],
    "effects": lambda word: _TRUTH[word.lower()],
    "hold": str,
    "effort": str,
    "time_limit": decimal_of,
    "temperatures": lambda word: tuple(decimal_of(part) for part in _parts(word)),
    "controllers": lambda word: tuple(_parts(word)),
    "set_aside": lambda word: _TRUTH[word.lower()],
    "force": lambda word: _TRUTH[word.lower()],
    "known": lambda word: tuple(_parts(word)),
    "nameplate": str,
}
_EXPECTED = {
    "seed": "an integer",
    "posterior": "true or false",
    "effects": "true or false",
    "hold": "auto, zoh or foh",
    "effort": "quick, normal or thorough",
    "time_limit": "a positive number of seconds",
    "temperatures": "temperatures in degC",
    "controllers": "controllers such as P:1 or PI:2,0.5",
    "set_aside": "true or false",
    "force": "true or false",
    "known": "known values such as Kt25=0.048+-5% or L=2.9e-3",
    "nameplate": "nameplate data such as voltage=12;no_load_speed=3000rpm",
}
