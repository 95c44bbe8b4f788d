"""Parsing and validation of the fit options in a manifest.

In a CSV cell, semicolons separate the entries of a list, and a truth value is true, yes or 1, or
false, no or 0, as docs/batch.md describes.
YAML uses its own booleans, numbers and lists; commas separate the entries of `nameplate`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field, TypeAdapter, ValidationError

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
    accepted: TypeAdapter[Any]


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
    option = _OPTIONS[name]
    try:
        found: object = option.accepted.validate_python(value, strict=True)
    except ValidationError:
        raise place.at(name).wrong(
            f"{str(value)[:60]!r} is not valid; expected {option.expected}"
        ) from None
    return tuple(found) if isinstance(found, list) else found


def _parts(word: str) -> list[str]:
    return [part.strip() for part in word.split(";") if part.strip()]


_FLAG = _Option("true or false", lambda word: _TRUTH[word.lower()], TypeAdapter(bool))
_OPTIONS = {
    "seed": _Option("an integer", whole_of, TypeAdapter(int)),
    "posterior": _FLAG,
    "effects": _FLAG,
    "hold": _Option("auto, zoh or foh", str, TypeAdapter(str)),
    "effort": _Option("quick, normal or thorough", str, TypeAdapter(str)),
    "time_limit": _Option("a positive number of seconds", decimal_of, TypeAdapter(float)),
    "temperatures": _Option(
        "temperatures in degC",
        lambda word: [decimal_of(part) for part in _parts(word)],
        TypeAdapter(Annotated[list[float], Field(min_length=1)]),
    ),
    "controllers": _Option(
        "controllers such as P:1 or PI:2,0.5",
        _parts,
        TypeAdapter(Annotated[list[str], Field(min_length=1)]),
    ),
    "set_aside": _FLAG,
    "force": _FLAG,
    "known": _Option(
        "known values such as Kt25=0.048+-5% or L=2.9e-3", _parts, TypeAdapter(list[str])
    ),
    "nameplate": _Option(
        "nameplate data such as voltage=12;no_load_speed=3000rpm", str, TypeAdapter(str)
    ),
}
