"""Cell parsing: split a line into cells and classify each as number, missing value or text."""

from __future__ import annotations

import csv
import re

from identification.ingest.display import quoted

__all__ = [
    "expected_instead",
    "is_clock",
    "is_number",
    "is_number_word",
    "number_text",
    "split_cells",
]

# No two parts of a pattern match the same digits: matching time is linear in the cell length.
_POINT = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_COMMA = re.compile(r"[+-]?(?:\d+(?:,\d*)?|,\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(
    r"[+-]?(?:nan|inf|infinity|1\.#(?:inf|qnan|ind)\d*|#?n/?a!?|nil|null|none|unendlich)",
    re.IGNORECASE,
)
_WORDS_AND_QUOTES = re.compile(r'"[^"]*"|\S+')
_WORDS_WITH_UNITS = re.compile(r'"[^"]*"|[^\s"\[(]\S*(?:[ \t]+[\[(][^\])]{0,40}[\])])?|\S+')
_CLOCK = re.compile(r"\d{1,4}[-/:]\d{1,2}[-/:]\d[\d:.,TZ +-]*|\d{1,2}\.\d{1,2}\.\d{4}[\d:., ]*")


def split_cells(line: str, delimiter: str, *, units_in_brackets: bool = False) -> list[str]:
    """Split one line without its end into cells, stripped of surrounding blanks.

    A space as delimiter stands for one or more blanks and tabs; ``speed [rpm]`` stays together on
    request.  A line with unbalanced quotation marks is a single cell.
    """
    if delimiter == " ":
        words = _WORDS_WITH_UNITS if units_in_brackets else _WORDS_AND_QUOTES
        return [word.strip('"') for word in words.findall(line)]
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except (csv.Error, StopIteration):
        return [line]
    return [cell.strip() for cell in row]


def number_text(cell: str, decimal: str) -> str | None:
    """Number text in the syntax of `float`, or None if the cell is not a plain number.

    `float` alone would also accept ``1_000``, ``nan`` and digits of other scripts.
    """
    if decimal == ",":
        return cell.replace(",", ".") if _COMMA.fullmatch(cell) else None
    return cell if _POINT.fullmatch(cell) else None


def is_number(cell: str) -> bool:
    """Return True if the cell is a number with a decimal point or comma.

    Between commas only a quoted cell contains a comma, which is then a decimal one.
    """
    return _POINT.fullmatch(cell) is not None or _COMMA.fullmatch(cell) is not None


def is_number_word(cell: str) -> bool:
    """Return True if the cell is a common spelling of a missing or infinite number."""
    return _NOT_FINITE.fullmatch(cell) is not None


def is_clock(cell: str) -> bool:
    """Return True if the cell is a date or a time of day."""
    return _CLOCK.fullmatch(cell) is not None


def expected_instead(cell: str, unit: str) -> str:
    """Message for a cell that is not a number: the fault and the fix."""
    wrong = f"{quoted(cell)} is not a number"
    if is_clock(cell):
        return f"{wrong}; a time of day is read only in a column of times whose first cell is one"
    if "," in cell and re.fullmatch(r"[+-]?[\d.,' ]+", cell):
        return (
            f"{wrong} in this file; use one decimal sign throughout the file "
            "and no thousands separators"
        )
    return f"{wrong}; expected a plain number in {unit}; correct the cell or remove its line"
