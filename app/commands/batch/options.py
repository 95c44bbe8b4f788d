"""Parsing and validation of the fit options in a manifest.

In a CSV cell, semicolons separate the entries of a list, and a truth value is true, yes or 1, or
false, no or 0, as docs/batch.md describes.
YAML uses its own booleans, numbers and lists; commas separate the entries of `nameplate`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

from pydantic import TypeAdapter

from identification.errors import InputError
from identification.numerals import decimal_of, whole_of
from identification.options import FitOptions

__all__ = ["Place", "option_of", "options_with"]

_TRUTH = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}


@dataclass(frozen=True)
class Place:
    """Source location of an error in a manifest."""

    path: Path
    row: int | None
    entry: str = ""
    column: str | None = None

    def at(self, column: str) -> Place:
        """Return the same location with a column name."""
        return replace(self, column=column)

    def wrong(self, message: str) -> InputError:
        """Return an error for this location."""
        text = f"{self.entry}: {message}" if self.entry else message
        return InputError(text, file=str(self.path), row=self.row, column=self.column)

    def only(self, entry: Mapping[Any, Any], known: Sequence[str]) -> None:
        """Reject an entry with unknown names."""
        for name in entry:
            if name not in known:
                raise self.wrong(f"has {str(name)[:60]!r}; expected only {', '.join(known)}")


class _Option(NamedTuple):
    expected: str
    of_word: Callable[[str], object]


def option_of(name: str, word: str, place: Place) -> object:
    """Parse the text of a CSV cell as the value of an option."""
    option = _OPTIONS[name]
    try:
        return option.of_word(word)
    except (ValueError, KeyError):
        raise place.wrong(f"{word[:60]!r} is not valid; expected {option.expected}") from None


def options_with(defaults: FitOptions, given: Mapping[Any, Any], place: Place) -> FitOptions:
    """Return the default options, overridden by the given values."""
    values: dict[str, Any] = {}
    for name, value in given.items():
        if name not in _OPTIONS:
            raise place.wrong(
                f"has the unknown option {name!r}; expected one of {', '.join(_OPTIONS)}"
            )
        values[name] = _checked(name, value, place)
    try:
        options = replace(defaults, **values)
        if "controllers" in values:
            from identification.speed_loop.controller import parse_controllers

            parse_controllers(options.controllers)
    except InputError as error:
        raise place.wrong(error.message) from error
    return options


def _checked(name: str, value: object, place: Place) -> object:
    """Check the type of a value; convert lists to tuples, and integers to floats where needed."""
    given = tuple(value) if isinstance(value, list) else value
    try:
        if given == () and name in _NEEDED:
            raise ValueError
        found: object = _TYPES[name].validate_python(given, strict=True)
    except ValueError:
        raise place.at(name).wrong(
            f"{str(value)[:60]!r} is not valid; expected {_OPTIONS[name].expected}"
        ) from None
    return found


def _parts(word: str) -> list[str]:
    return [part.strip() for part in word.split(";") if part.strip()]


_FLAG = _Option("true or false", lambda word: _TRUTH[word.lower()])
_OPTIONS = {
    "seed": _Option("an integer", whole_of),
    "posterior": _FLAG,
    "effects": _FLAG,
    "hold": _Option("auto, zoh or foh", str),
    "effort": _Option("quick, normal or thorough", str),
    "time_limit": _Option("a positive number of seconds", decimal_of),
    "temperatures": _Option(
        "temperatures in degC", lambda word: [decimal_of(part) for part in _parts(word)]
    ),
    "controllers": _Option("controllers such as P:1 or PI:2,0.5", _parts),
    "set_aside": _FLAG,
    "force": _FLAG,
    "known": _Option("known values such as Kt25=0.048+-5% or L=2.9e-3", _parts),
    "nameplate": _Option("nameplate data such as voltage=12;no_load_speed=3000rpm", str),
}
_TYPES = {name: TypeAdapter(kind) for name, kind in get_type_hints(FitOptions).items()}
_NEEDED = ("temperatures", "controllers")
