"""Dates and times of day as seconds from the first sample.

    08:00:00.125        2026-03-01T08:00:00.125Z        01.03.2026 08:00:00,125

Times are counted in whole nanoseconds, which a floating point number of seconds since 1970 loses.
"""

from __future__ import annotations

import datetime
import re

__all__ = ["ClockTimes", "is_time_of_day"]

_TIME = re.compile(
    r"(?:(?P<date>\d[\d./-]{7,9})[T ] ?)?(?P<h>\d{1,2}):(?P<m>\d{2}):(?P<s>\d{2})"
    r"(?:[.,:](?P<fraction>\d{1,12}))?(?:Z|(?P<zone>[+-]\d{2}:?\d{2}))?",
    re.ASCII,
)
_YEAR_FIRST = re.compile(r"(\d{4})[./-](\d{1,2})[./-](\d{1,2})", re.ASCII)
_DAY_FIRST = re.compile(r"(\d{1,2})\.(\d{1,2})\.(\d{4})", re.ASCII)
_SECOND = 1_000_000_000
_DAY = 86_400 * _SECOND


def is_time_of_day(cell: str) -> bool:
    """Return True for a time of day, with or without a date."""
    return _TIME.fullmatch(cell) is not None


class ClockTimes:
    """Reader of the times of one column, in the order of the file."""

    def __init__(self) -> None:
        self._first: int | None = None
        self._last = 0
        self._days = 0
        self._date = ""

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
        seconds = (int(match["h"]) * 60 + int(match["m"])) * 60 + int(match["s"])
        zone = (match["zone"] or "").replace(":", "")
        if zone:
            minutes = int(zone[1:3]) * 60 + int(zone[3:5])
            seconds -= minutes * 60 if zone[0] == "+" else -minutes * 60
        fraction = (match["fraction"] or "")[:9].ljust(9, "0")
        return seconds * _SECOND + int(fraction)

    def _day(self, date: str) -> int | None:
        """Number of a day, or 0 for the first date of unknown order and None for another one."""
        year_first, day_first = _YEAR_FIRST.fullmatch(date), _DAY_FIRST.fullmatch(date)
        numbers = None
        if year_first is not None:
            numbers = [int(text) for text in year_first.groups()]
        elif day_first is not None:
            numbers = [int(text) for text in reversed(day_first.groups())]
        if numbers is None:
            self._date = self._date or date
            return 0 if date == self._date else None
        try:
            return datetime.date(*numbers).toordinal()
        except ValueError:
            return None
