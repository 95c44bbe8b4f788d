"""Cell parsing: split a line into cells and read each as number, time, missing value or text."""

from __future__ import annotations

import csv
import datetime
import decimal
import re

from identification.ingest.display import quoted
from identification.ingest.units import UNITS

__all__ = [
    "ClockTimes",
    "LongTimes",
    "clock_of",
    "expected_instead",
    "finer_unit",
    "is_clock",
    "is_number",
    "is_number_word",
    "is_time_of_day",
    "is_whole_second",
    "number_text",
    "split_cells",
]

# No two parts of a pattern match the same digits: matching time is linear in the cell length.
_POINT = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_COMMA = re.compile(r"[+-]?(?:\d+(?:,\d*)?|,\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_NOT_FINITE = re.compile(
    r"[+-]?(?:nan|inf|infinity|1\.#(?:inf|qnan|ind)\d*|#?n/?a!?|nil|null|none|unendlich|∞)",
    re.IGNORECASE,
)
# A label stays with its number: U: 12.5
_WORDS_AND_QUOTES = re.compile(r'"[^"]*"|[^\W\d][^\s:="]*[:=][ \t]+[+-]?[\d.]\S*|\S+')
_WORDS_WITH_UNITS = re.compile(r'"[^"]*"|[^\s"\[(]\S*(?:[ \t]+[\[(][^\])]{0,40}[\])])?|\S+')
_CLOCK = re.compile(r"\d{1,4}[-/:]\d{1,2}[-/:]\d[\d:.,TZ +-]*|\d{1,2}\.\d{1,2}\.\d{4}[\d:., ]*")
_TIME = re.compile(
    r"(?:(?P<date>\d[\d./-]{7,9}|\d\d-[A-Za-z]{3}-\d{4})[T ] ?)?"
    r"(?:(?P<h>\d{1,5}):|(?=\d\d:\d\d[.,]))(?P<m>\d{2}):(?P<s>\d{2})"
    r"(?:[.,:](?P<fraction>\d{1,12}))?(?: (?P<half>[AP])M)?(?:Z|(?P<zone>[+-]\d{2}:?\d{2}))?",
    re.ASCII,
)
_YEAR_FIRST = re.compile(r"(?P<y>\d{4})[./-](?P<m>\d{1,2})[./-](?P<d>\d{1,2})", re.ASCII)
_DAY_FIRST = re.compile(r"(?P<d>\d{1,2})\.(?P<m>\d{1,2})\.(?P<y>\d{4})", re.ASCII)
# No elapsed time; the year 2001.
_SINCE_1970_S = 1e9
_LATEST_S = 1e11
_SECOND = 1_000_000_000
_DAY = 86_400 * _SECOND


def split_cells(line: str, delimiter: str, *, units_in_brackets: bool = False) -> list[str]:
    """Split one line without its end into cells, stripped of surrounding blanks.

    A space as delimiter stands for one or more blanks and tabs; ``speed [rpm]`` stays together on
    request.  A line with unbalanced quotation marks is a single cell; within a cell, as in
    ``"Drive".speed``, they are part of it.
    """
    if delimiter == " ":
        words = _WORDS_WITH_UNITS if units_in_brackets else _WORDS_AND_QUOTES
        return [word.strip('"') for word in words.findall(line)]
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except (csv.Error, StopIteration):
        return [line] if line.count('"') % 2 else [c.strip() for c in line.split(delimiter)]
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
    return _CLOCK.fullmatch(cell) is not None or is_time_of_day(cell)


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


def is_time_of_day(cell: str) -> bool:
    """Return True for a time of day, with or without a date."""
    return ":" in cell and _TIME.fullmatch(cell) is not None


def is_whole_second(cell: str) -> bool:
    """Return True for a time of day without a fraction of the second."""
    match = _TIME.fullmatch(cell)
    return match is not None and match["fraction"] is None


def clock_of(cell: str, seconds: float, first: str = "") -> ClockTimes | LongTimes | None:
    """Reader of times of day or since 1970 by their first cell; None for other cells.

    A time that is a number has the unit `seconds` [s]; `first` is as in `ClockTimes`.
    """
    number = number_text(cell.replace(",", "."), ".")
    if number is not None and float(number) * seconds >= _SINCE_1970_S:
        return LongTimes(first if is_number(first) else number)
    return ClockTimes(first) if is_time_of_day(cell) else None


def finer_unit(cell: str, seconds: float) -> str:
    """Unit of a time since 1970 that would be later than the year 5000 in its unit, else blank.

    The unit of the first time, such as 1772352000001000000 of ROS, is `seconds` [s].
    """
    number = number_text(cell.replace(",", "."), ".")
    if number is None or float(number) * seconds < _LATEST_S:
        return ""
    times = (unit for unit in UNITS if unit.quantity == "time")
    known = (u.name for u in times if _SINCE_1970_S <= float(number) * u.factor < _LATEST_S)
    return next(known, "")


class LongTimes:
    """Reader of times since 1970, which have more digits than a floating point number.

    1772352000.001000000 becomes 52000.001: the five leading digits of the first time of the file
    are left out.
    """

    def __init__(self, first: str) -> None:
        number = decimal.Decimal(first.replace(",", "."))
        self._base = number - number % decimal.Decimal(10) ** (number.adjusted() - 4)

    def seconds(self, cell: str) -> float | None:
        """Time after the round number, in the unit of the file; None if it is no number."""
        text = number_text(cell.replace(",", "."), ".")
        return None if text is None else float(decimal.Decimal(text) - self._base)


class ClockTimes:
    """Reader of the dates and times of day of one column, in the order of the file.

        08:00:00.125        2026-03-01T08:00:00.125Z        01.03.2026 08:00:00,125
        00:00.125           3/1/2026 8:00:00.125 AM         01-Mar-2026 08:00:00.125

    Times are counted in whole nanoseconds, which a floating point number of seconds since 1970
    loses, from `first`, the first time of another column, or else from that of this one.
    """

    def __init__(self, first: str = "") -> None:
        self._first: int | None = None
        self._last = 0
        self._days = 0
        self._date = ""
        self.seconds(first)

    def seconds(self, cell: str) -> float | None:
        """Seconds from the first cell to this one [s]; None if the cell is no time of day.

        A time of day without a date that falls by more than twelve hours is that of the next day.
        A date such as 03/01/2026, whose order is not known, must be the same in all cells.
        """
        match = _TIME.fullmatch(cell)
        if match is None:
            return None
        ticks = self._ticks_of_day(match)
        date = match["date"]
        if date is None:
            if ticks + self._days * _DAY < self._last - _DAY // 2:
                self._days += 1
            ticks += self._days * _DAY
            self._last = ticks
        else:
            days = self._day(date)
            if days is None:
                return None
            ticks += days * _DAY
        if self._first is None:
            self._first = ticks
        return (ticks - self._first) / _SECOND

    def _ticks_of_day(self, match: re.Match[str]) -> int:
        """Nanoseconds since midnight, in UTC if the cell gives its zone."""
        hours = int(match["h"] or 0)
        if match["half"]:
            hours = hours % 12 + 12 * (match["half"] == "P")
        seconds = (hours * 60 + int(match["m"])) * 60 + int(match["s"])
        zone = (match["zone"] or "+0000").replace(":", "")
        seconds -= (int(zone[:3]) * 60 + int(zone[0] + zone[3:])) * 60
        fraction = (match["fraction"] or "")[:9].ljust(9, "0")
        return seconds * _SECOND + int(fraction)

    def _day(self, date: str) -> int | None:
        """Number of a day, or 0 for the first date of unknown order and None for another one."""
        match = _YEAR_FIRST.fullmatch(date) or _DAY_FIRST.fullmatch(date)
        if match is None:
            self._date = self._date or date
            return 0 if date == self._date else None
        try:
            return datetime.date(int(match["y"]), int(match["m"]), int(match["d"])).toordinal()
        except ValueError:
            return None
