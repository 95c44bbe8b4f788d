"""Sample interval that the title lines of a device state, for a table without times.

Time interval : ,1.00000mS,1.00000mS      OWON, one for each channel
# CLOCK=20.0uS                            Hantek
Sample rate: 1000 Hz                      Dewesoft and other loggers
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from identification.ingest.run import RunWarning
from identification.ingest.units import find_unit

__all__ = ["interval_warning", "stated_interval"]

# A title line that states the interval or the rate, and each number with a unit in it.
_PACE = re.compile(
    r"\W*(?:(?:sampl\w*|time|recording)[ _]?(?:interval|period|rate)|(?P<clock>clock))\b", re.I
)
_PACES = re.compile(r"(\d+(?:[.,]\d+)?(?:e[+-]?\d+)?)\W{0,3}([a-zµμ/]+)", re.I)
_RATE = re.compile(r"(?P<prefix>[kMG]?)(?:Hz|Sa?/s)")
_PREFIXES = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}


def stated_interval(titles: Sequence[str]) -> float:
    """Sample interval [s] that title lines state with its unit; NaN if none does or they differ."""
    found = {
        # The clock of a processor is a frequency.
        _seconds(number, unit) if key["clock"] is None or not _RATE.fullmatch(unit) else math.nan
        for title in titles
        if (key := _PACE.match(title)) is not None
        for number, unit in _PACES.findall(title[key.end() :])
    }
    return found.pop() if len(found) == 1 else math.nan


def interval_warning(interval: float, file: str) -> RunWarning:
    """Warning of a table whose times are multiples of a stated interval [s]."""
    text = (
        "the time is the number of the sample times the interval of a title line, "
        f"{interval:.6g} s; a lost sample shows as no gap"
    )
    return RunWarning("time_from_rows", text, file)


def _seconds(text: str, unit: str) -> float:
    """Interval of a rate or an interval with its unit [s]; NaN for any other unit."""
    number = float(text.replace(",", "."))
    rate, known = _RATE.fullmatch(unit), find_unit(unit) or find_unit(unit.lower())
    if rate is not None and number > 0.0:
        return 1.0 / (number * _PREFIXES[rate["prefix"]])
    return number * known.factor if known is not None and known.quantity == "time" else math.nan
