"""Cells that a mapping supplies: a constant, the number of the sample, or a sign.

    {"voltage_V": {"value": 12}}
    {"time_s": {"column": "row", "scale": 0.001}}
    {"voltage_V": {"column": "pwm", "scale": 0.24, "sign": "dir"}}

The sign multiplies the cell, before scale and offset.  It comes from a column of directions: 1, 0
and -1, or words of `DIRECTIONS`.  In a column of 0 and 1, as of a direction pin, 0 is reverse; in
one with 2, 1 is forward, 2 reverse and 0 a stop.  The letters F, R and N are forward, reverse and
neutral, and L and R left and right.  Which direction is positive cannot be known; the
check of the signs reports a wrong one.

A stop is a factor of 0.  A bridge that brakes shorts the motor, so its voltage is 0 V whatever the
duty beside it is; a current or a speed at a stop is not zero, and its sign is not known.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from identification.arrays import Array, Bool
from identification.errors import AbsurdValue, NotANumber
from identification.ingest.channels import Channel
from identification.ingest.display import quoted
from identification.ingest.reader import Samples
from identification.ingest.run import RunWarning, SourceLocator
from identification.ingest.units import canonical_unit

__all__ = ["DIRECTIONS", "STOP", "direction_of", "requested", "supplied"]

_FORWARD = "cw clockwise f fwd forward forwards + pos positive right true vorwärts rechts"
_BACKWARD = (
    "ccw counterclockwise counter-clockwise anticlockwise rev reverse backward backwards - neg "
    "negative left false rückwärts links"
)
_STOPPED = (
    "stop stopped halt brake braked braking coast coasting off idle n neutral aus stillstand "
    "bremse bremsen freilauf"
)
STOP = math.ulp(0.0)
"""Stop in words: the smallest number in place of 0, since the 0 of a direction pin is reverse."""

DIRECTIONS = (
    dict.fromkeys(_FORWARD.split(), 1.0)
    | dict.fromkeys(_BACKWARD.split(), -1.0)
    | dict.fromkeys(_STOPPED.split(), STOP)
)
"""Factor of each accepted word, in lower case; docs/run-files.md prints them."""

_LETTERS: Final = {"l": math.nextafter(-1.0, 0.0), "r": math.nextafter(-1.0, -2.0)}
"""Code of a letter whose meaning the others of its column decide, see `_of_letters`."""

_REVERSE: Final = 2.0
"""Reverse in a column of the codes 0, 1 and 2."""
_CODED: Final = " (1 is forward, 2 reverse, 0 a stop)"
_STILL: Final = 0.02
"""Fraction of the largest cell above which a cell is not zero."""
_EXPECTED: Final = (
    "expected 1, 0 or -1 in each cell, or 1 and 0, or 1 for forward, 2 for reverse and 0 for a stop"
)
_UNAMBIGUOUS: Final = (
    "the cell that it signs is not 0, and in a column with 2 expected is 0 for a stop only; write "
    "fwd, rev and stop, or 1, -1 and 0"
)
_UNSIGNED: Final = (
    "stands at a stop, expected is 0: a motor that brakes or coasts has a current and a speed, "
    "whose sign the direction does not give; map a signed column or cut these samples out"
)


def requested(channels: Mapping[str, Channel]) -> tuple[Channel, ...]:
    """Channels whose cells a table has to read, and one for the column of each sign."""
    logged = [channel for channel in channels.values() if channel.is_logged]
    signs = {_sign_name(c.name): c.sign for c in logged if c.sign is not None}
    ratio = canonical_unit("duty")
    return (*logged, *(Channel(n, c, ratio, is_direction=True) for n, c in signs.items()))


def _sign_name(name: str) -> str:
    return f"sign of {name}"


def supplied(
    samples: Samples, channels: Mapping[str, Channel], locator: SourceLocator
) -> tuple[Samples, list[RunWarning]]:
    """Complete the cells that were read; return them with warnings of signs and rows.

    Raises:
        AbsurdValue: A direction is a number other than 1, 0 and -1, or a current or speed is not
            zero at a stop.
    """
    rows = next(iter(samples.cells.values())).size
    cells = {name: samples.cells[name] for name in channels if name in samples.cells}
    notes: list[RunWarning] = []
    for name, channel in channels.items():
        if channel.value is not None:
            cells[name] = np.full(rows, channel.value)
        elif not channel.is_logged:
            cells[name] = np.arange(rows, dtype=np.float64)
            note = "the time is the number of the sample times its interval; a lost sample shows as"
            notes.append(locator.warning("time_from_rows", f"{note} no gap", name))
        elif channel.sign is not None:
            column, directions = channel.sign.label, samples.cells[_sign_name(name)]
            at = dataclasses.replace(locator, columns={**locator.columns, name: column})
            signs, text = _signs(directions, cells[name], name, at)
            text = f"{text}, by the column {column}{_stopped(signs, cells[name], name, locator)}"
            cells[name] = cells[name] * signs
            notes.append(locator.warning("sign_from_direction", text, name))
    return dataclasses.replace(samples, cells=cells), notes


def _signs(directions: Array, cells: Array, name: str, locator: SourceLocator) -> tuple[Array, str]:
    """Factors (n_sample,) 1, -1 and 0 of a direction, and what the warning says of them."""
    directions = _of_letters(directions)
    stops, meaning = directions == STOP, ""
    is_coded = bool(np.any(directions == _REVERSE)) and not np.any(directions < 0.0)
    known = (0.0, STOP, 1.0, _REVERSE if is_coded else -1.0)
    _refuse(~np.isin(directions, known), directions, f"is no direction; {_EXPECTED}", name, locator)
    if is_coded:
        moving = _is_moving(cells) & (directions == 0.0)
        _refuse(moving, directions, f"is forward or a stop; {_UNAMBIGUOUS}", name, locator)
        signs, meaning = np.where(directions == _REVERSE, -1.0, directions), _CODED
    elif np.any(directions == 0.0) and not np.any(directions < 0.0):
        signs, meaning = np.where(directions > 0.0, 1.0, -1.0), " (0 is reverse)"
    else:
        signs = directions
    signs = np.where(stops, 0.0, signs)
    reverse = int(np.count_nonzero(signs < 0.0))
    return signs, f"the sign is negative in {reverse} of {signs.size} samples{meaning}"


def _of_letters(directions: Array) -> Array:
    """Directions (n_sample,) with 1 or -1 for a letter: R is right beside an L, else reverse."""
    left, other = (directions == code for code in _LETTERS.values())
    of_other = 1.0 if np.any(left) else -1.0
    return np.where(left, -1.0, np.where(other, of_other, directions))


def _stopped(signs: Array, cells: Array, name: str, locator: SourceLocator) -> str:
    """Part of the warning on samples (n_sample,) with a factor of 0; empty without any."""
    stops = signs == 0.0
    if not np.any(stops):
        return ""
    text = f"; {np.count_nonzero(stops)} are a stop with a factor of 0"
    moving = stops & _is_moving(cells)
    if name in ("current_A", "speed_rad_s"):
        _refuse(moving, cells, _UNSIGNED, name, locator)
    elif np.any(moving):
        text += (
            f", and the cell is not 0 in {np.count_nonzero(moving)} of these: the motor is taken "
            "as braked, which is 0 V"
        )
    return text


def _is_moving(cells: Array) -> Bool:
    """Cells (n_sample,) that are not zero."""
    return np.asarray(np.abs(cells) > _STILL * np.max(np.abs(cells), initial=0.0))


def _refuse(wrong: Bool, values: Array, reason: str, name: str, locator: SourceLocator) -> None:
    """Refuse the first wrong sample (n_sample,) of a column."""
    if np.any(wrong):
        sample = int(np.argmax(wrong))
        value = float(values[sample])
        raise locator.error(AbsurdValue, f"{value:.6g} {reason}", name, sample, value)


def direction_of(cell: str, column: str, row: int) -> float:
    """Factor of a word, or the number in the cell of a direction.

    Raises:
        NotANumber: The cell is neither.
    """
    word = cell.strip().casefold()
    factor = DIRECTIONS.get(word, _LETTERS.get(word))
    if factor is not None:
        return factor
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        raise NotANumber(
            f"{quoted(cell)} is no direction; expected 1, 0 or -1, or a word such as CW, CCW, fwd, "
            "rev or stop",
            row=row,
            column=column,
            value=cell,
        ) from None
