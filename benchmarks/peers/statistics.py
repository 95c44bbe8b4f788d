"""Statistics of the log: medians over repetitions, agreement of posteriors, exponents of cost."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

__all__ = [
    "Line",
    "agreement",
    "exponent",
    "median",
    "names_of",
    "of",
    "rates",
    "seconds_per_thousand",
    "shift",
    "sizes_of",
    "spread_ratio",
]

Line = dict[str, Any]


def of(lines: Iterable[Line], part: str, name: str = "", rows: int = 0) -> list[Line]:
    """Successful lines of a part, and of one program and size if given."""
    return [
        line
        for line in lines
        if line["part"] == part
        and name in ("", line["name"])
        and rows in (0, line["rows"])
        and "failed" not in line
    ]


def sizes_of(lines: Sequence[Line], part: str) -> list[int]:
    """Measured numbers of rows of a part, ascending."""
    return sorted({line["rows"] for line in of(lines, part)})


def names_of(lines: Sequence[Line], part: str, rows: int) -> list[str]:
    """Measured programs of a part, in the order of the log."""
    return list(dict.fromkeys(line["name"] for line in of(lines, part, rows=rows)))


def median(lines: Sequence[Line], value: Callable[[Line], float]) -> float:
    """Median of a value over repetitions."""
    return statistics.median(value(line) for line in lines)


def rates(lines: Sequence[Line], kind: str = "cpu_s") -> float:
    """Median of the effective samples per second.

    Args:
        lines: Repetitions of one sampler.
        kind: ``cpu_s`` or ``wall_s``, with ``_with_warm_up`` to include it.
    """
    return median(lines, lambda line: line[f"ess_per_{kind}"])


def seconds_per_thousand(lines: Sequence[Line]) -> float:
    """Processor time of a thousand effective samples after the warm-up [s]."""
    return 1000.0 / rates(lines)


def agreement(one: Line, other: Line) -> float:
    """Largest difference of two posterior means in its Monte Carlo standard errors.

    The standard error of a mean is sd / sqrt(ESS); with nine parameters, one comparison in a
    hundred exceeds 3.3.
    """
    errors = [np.array(line["sd"]) / np.sqrt(line["ess"]) for line in (one, other)]
    difference = np.array(one["mean"]) - np.array(other["mean"])
    return float(np.max(np.abs(difference) / np.hypot(*errors)))


def shift(one: Line, other: Line) -> float:
    """Largest difference of two posterior means in posterior standard deviations."""
    difference = np.array(one["mean"]) - np.array(other["mean"])
    return float(np.max(np.abs(difference) / np.array(other["sd"])))


def spread_ratio(one: Line, other: Line) -> float:
    """Standard deviation over that of another posterior, the most deviating parameter."""
    ratios = np.array(one["sd"]) / np.array(other["sd"])
    return float(ratios[np.argmax(np.abs(np.log(ratios)))])


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """Exponent p of cost ~ size^p by least squares of the logarithms; NaN for one size."""
    if len(set(sizes)) < 2:
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])
