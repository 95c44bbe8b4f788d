"""Number formatting: digits according to the interval width, one common power of ten.

interval_text(0.59034, 0.58951, 0.59117) -> Interval("0.5903", "0.5895", "0.5912", "")
interval_text(4.2131e-5, 4.201e-5, 4.226e-5) -> Interval("4.213", "4.201", "4.226", " ×10⁻⁵")
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

__all__ = [
    "UNKNOWN",
    "Interval",
    "count_text",
    "entry_text",
    "finite",
    "interval_text",
    "listed",
    "number_text",
    "percent_text",
    "probability_text",
    "scaled_unit",
    "signed_percent_text",
    "unit_power",
    "unit_prefix",
    "unit_text",
    "with_symbols",
]

UNKNOWN = "–"

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UNITS = {
    "ohm": "Ω",
    "1/K": "1/K",
    "N m/A": "N·m/A",
    "kg m^2": "kg·m²",
    "N m s/rad": "N·m·s/rad",
    "degC": "°C",
    "N m": "N·m",
    "1": "",
    "-": "",
}


@dataclass(frozen=True)
class Interval:
    """Median and interval ends as text, with equal decimals and a common power of ten."""

    median: str
    low: str
    high: str
    power: str


def interval_text(median: float | None, low: float | None, high: float | None) -> Interval:
    """Format a median and its interval to the digits that the interval width supports.

    The standard deviation, a third of the width, is given two digits if it begins with 100 to 354
    and one digit if it begins with 355 to 949.

    Source: Particle Data Group, Review of Particle Physics, introduction, section 5.3.
    """
    median, low, high = finite(median), finite(low), finite(high)
    known = [value for value in (median, low, high) if value is not None]
    if known and not any(known):
        middle, lower, upper = ("0" if value == 0.0 else UNKNOWN for value in (median, low, high))
        return Interval(middle, lower, upper, "")
    exponent = _exponent(max((abs(value) for value in known), default=0.0))
    scale = 10.0**-exponent
    if low is not None and high is not None and high > low:
        # The width of subnormal numbers may be zero, which has no logarithm.
        decimals = _supported(max((high * scale - low * scale) / 3.29, 1e-12))
    else:
        decimals = 4 - _leading(max((abs(value) for value in known), default=1.0) * scale)
    decimals = min(max(decimals, 0), 9)
    middle, lower, upper = (_fixed(value, scale, decimals) for value in (median, low, high))
    if median and low and low * (high or 0.0) > 0.0 and float(middle.replace("−", "-")) == 0.0:
        # The interval covers decades, and the median is small beside its width.
        middle, lower, upper = (number_text(value, 2) for value in (median, low, high))
        return Interval(middle, lower, upper, "")
    return Interval(middle, lower, upper, _power(exponent))


def entry_text(entry: Mapping[str, Any], factor: float = 1.0) -> Interval:
    """`interval_text` of a QUANTITY of the result, multiplied by the factor of `unit_prefix`."""
    ends = (entry[key] for key in ("median", "q05", "q95"))
    return interval_text(*(None if end is None else factor * end for end in ends))


def _supported(deviation: float) -> int:
    """Decimals that a standard deviation supports."""
    power = math.floor(math.log10(deviation))
    leading = deviation / 10.0**power
    return (0 if 3.545 <= leading < 9.495 else 1) - (power + (leading >= 9.495))


def number_text(value: float | None, digits: int = 4) -> str:
    """Format a number to `digits` significant digits; an en dash if unknown."""
    value = finite(value)
    if value is None:
        return UNKNOWN
    # Round first: 0.99996 to four digits is 1.000, with one digit before the point.
    value = finite(float(f"{value:.{digits - 1}e}")) or value
    exponent = _exponent(abs(value))
    scaled = value * 10.0**-exponent
    decimals = min(max(digits - _leading(abs(scaled)), 0), 9)
    return _fixed(value, 10.0**-exponent, decimals) + _power(exponent)


def percent_text(share: float | None, digits: int = 3) -> str:
    """Format a fraction as per cent; an en dash if unknown."""
    share = finite(share)
    if share is None:
        return UNKNOWN
    return f"{number_text(100.0 * share, digits)} %"


def probability_text(share: float | None) -> str:
    """Format a probability as per cent with one decimal, from "< 0.1 %" to "> 99.9 %".

    A probability of 1 is one that was rounded: no finite record makes a model certain.
    """
    share = finite(share)
    if share is None:
        return UNKNOWN
    if 0.0 <= share < 0.001:
        return "< 0.1 %"
    if not 0.0 <= share <= 1.0:
        return percent_text(share)
    return "> 99.9 %" if share > 0.999 else f"{100.0 * share:.1f} %"


def unit_prefix(unit: str, values: Iterable[float | None]) -> tuple[float, str]:
    """Factor and unit in which people read times and inductances: 2.12 ms rather than 0.00212 s.

    The values share the unit, such as one row of a table; only s and H get a prefix.
    """
    sizes = [abs(value) for value in map(finite, values) if value]
    if unit not in ("s", "H") or not sizes or max(sizes) >= 1.0 or max(sizes) < 1e-7:
        return 1.0, unit
    return (1e3, f"m{unit}") if max(sizes) >= 1e-3 else (1e6, f"µ{unit}")


def signed_percent_text(share: float | None) -> str:
    """Format a relative change as per cent with its sign; an en dash if unknown."""
    share = finite(share)
    if share is None:
        return UNKNOWN
    percent = 100.0 * share
    if abs(percent) >= 1e6:
        return f"{'+' if percent > 0 else ''}{number_text(percent, 3)} %"
    if -100.0 < percent < -99.0:
        # A reduction by 99.7 % is not one to nothing.
        return f"−{min(-percent, 99.99):.2f} %"
    digits = 0 if abs(percent) >= 10.0 else 1 if abs(percent) >= 1.0 else 2
    text = f"{percent:+.{digits}f} %".replace("-", "−")
    return text if float(text[1:-2]) else text[1:]


def count_text(value: int | None) -> str:
    """Format a count with narrow spaces between thousands; an en dash if unknown."""
    return UNKNOWN if value is None else f"{value:,}".replace(",", "\u202f")


def listed(words: Sequence[str]) -> str:
    """Words as an enumeration: commas, and "and" before the last."""
    return " and ".join([*([", ".join(words[:-1])] if len(words) > 1 else []), *words[-1:]])


def unit_text(unit: str) -> str:
    """Typographic unit: ``kg m^2`` becomes ``kg·m²``; other units get superscripts only."""
    return _UNITS.get(unit, unit.replace("^2", "²").replace("^3", "³"))


def with_symbols(sentence: str) -> str:
    """Sentence with the symbols of degrees Celsius and ohms."""
    return sentence.replace(" degC", " °C").replace(" ohm", " Ω")


def unit_power(size: float) -> int:
    """Power of ten to factor out of an axis whose largest value is `size`; 0 for plain numbers."""
    known = finite(size)
    if known is None or known <= 0.0 or 0.05 <= known < 1000.0:
        return 0
    return max(math.floor(math.log10(known)), _LEAST_EXPONENT)


def scaled_unit(unit: str, power: int) -> str:
    """Unit with the power of ten that was factored out, such as ``10⁻⁵ kg·m²``."""
    return f"{_ten(power)} {unit_text(unit)}".strip() if power else unit_text(unit)


def finite(value: object) -> float | None:
    """The number as a float; None if missing, not finite or beyond the range of floats.

    A member of an edited result that is no number counts as missing.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


_LEAST_EXPONENT = -300
"""Smallest power of ten that is factored out; the inverse of a smaller one would overflow."""


def _exponent(size: float) -> int:
    """Power of ten to factor out: 0 for easily read numbers, else the one that leaves one digit."""
    if size == 0.0 or 1e-3 <= size < 1e5:
        return 0
    return max(math.floor(math.log10(size)), _LEAST_EXPONENT)


def _leading(size: float) -> int:
    """Number of digits before the point; for a size below 0.1, minus the zeros after the point."""
    return math.floor(math.log10(size)) + 1 if size > 0.0 else 1


def _fixed(value: float | None, scale: float, decimals: int) -> str:
    if value is None:
        return UNKNOWN
    text = f"{value * scale:.{decimals}f}"
    is_zero = float(text) == 0.0
    return text.lstrip("-") if is_zero else text.replace("-", "−")


def _power(exponent: int) -> str:
    return f" ×{_ten(exponent)}" if exponent else ""


def _ten(exponent: int) -> str:
    return f"10{str(exponent).translate(_SUPERSCRIPT)}"
