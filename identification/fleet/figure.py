"""Plots of one parameter: over the motors of a fleet, and over the fits of one motor.

The motors are sorted by their medians, beside their changes since the last refit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np

from identification.arrays import Array
from identification.fleet.drift import Drift
from identification.fleet.outliers import POSITIVE, Spread
from identification.fleet.pooling import Quantiles
from identification.fleet.refit import Refit
from identification.quantities import DECLARED_PARAMETERS
from identification.reporting.svg import Frame, framed, path, span, svg, text, tick_words
from identification.result.numbers import (
    interval_text,
    number_text,
    scaled_unit,
    unit_power,
    unit_prefix,
    unit_text,
)

__all__ = ["Mark", "fleet_figure", "history_figure", "marks_of"]


_LEFT, _WIDTH, _TOP = 84.0, 802.0, 10.0
_LEVELS, _CHANGES, _GAP = 190.0, 120.0, 26.0
_MOST_NAMED = 40
_APART = 11.0
_LONGEST_NAME = 17
_LETTER = 6.6
_WIDE_LETTER = 10.5
_SHIFT = 6.0
_DECADES_FOR_LOG = 1.5
_NORMAL_90 = 1.645


@dataclass(frozen=True)
class Mark:
    """Plotted values of one motor for one parameter: median and 90 % interval, and its change."""

    motor: str
    median: float
    q05: float
    q95: float
    score: float | None
    """Deviation from the fleet median in robust standard deviations [-]."""
    is_outlier: bool
    drift: Drift | None
    """Change since the last refit, or None."""
    change_sd: float
    """Standard deviation of that change."""
    pooled: Quantiles | None = None
    """Quantiles 5, 50 and 95 % pooled over the motors of the type, or None."""

    @property
    def is_significant(self) -> bool:
        """True if the change since the last refit is significant."""
        return self.drift is not None and self.drift.is_significant is True


def marks_of(
    name: str,
    refits: Sequence[Refit],
    spread: Spread,
    changes: Sequence[dict[str, Drift]],
    pooled: Mapping[int, Quantiles],
) -> list[Mark]:
    """Motors whose data identify a parameter, sorted by median; pooled quantiles are by index."""
    marks = []
    for index, refit in enumerate(refits):
        estimate = refit.estimates.get(name)
        if estimate is None or estimate.usable is None or estimate.median is None:
            continue
        drift = changes[index].get(name)
        sds = drift.sds if drift else None
        marks.append(
            Mark(
                motor=refit.motor,
                median=estimate.median,
                q05=estimate.median if estimate.q05 is None else estimate.q05,
                q95=estimate.median if estimate.q95 is None else estimate.q95,
                score=spread.scores[index],
                is_outlier=spread.is_outlier(index),
                drift=drift,
                change_sd=abs(drift.absolute / sds) if drift and sds else 0.0,
                pooled=pooled.get(index),
            )
        )
    return sorted(marks, key=lambda mark: mark.median)


def fleet_figure(name: str, marks: Sequence[Mark], spread: Spread) -> str:
    """SVG plot of one parameter over the fleet, from at least one mark."""
    unit = DECLARED_PARAMETERS[name].unit
    has_changes = any(mark.drift for mark in marks)
    across = _LEFT + _WIDTH * (np.arange(len(marks)) + 0.5) / len(marks)
    body = _levels(name, unit, marks, across, spread)
    bottom = _TOP + _LEVELS
    if has_changes:
        body += _changes(name, unit, marks, across, bottom + _GAP)
        bottom += _GAP + _CHANGES
    names, room = _names(marks, across, bottom)
    body += names + _hovers(marks, across, bottom, unit)
    caption = (
        f"{len(marks)} motors from {number_text(marks[0].median)} to "
        f"{number_text(marks[-1].median)} {unit}, "
        f"{sum(mark.is_outlier for mark in marks)} outliers, "
        f"{sum(mark.is_significant for mark in marks)} with a significant drift."
    )
    return svg(_LEFT + _WIDTH + 14, bottom + room + 8, f"{name} over the fleet", caption, body)


def _levels(name: str, unit: str, marks: Sequence[Mark], across: Array, spread: Spread) -> str:
    """Medians with their 90 % intervals."""
    low, middle, high = np.array([(mark.q05, mark.median, mark.q95) for mark in marks]).T
    box = (_LEFT, _TOP, _WIDTH, _LEVELS)
    is_log = bool(low.min() > 0.0 and math.log10(high.max() / low.min()) > _DECADES_FOR_LOG)
    largest = float(np.abs([low, high]).max())
    factor, unit = (1.0, unit) if is_log else unit_prefix(unit, [largest])
    power = 0 if is_log else unit_power(factor * largest)

    def scaled(values: Array) -> Array:
        return np.asarray(np.log10(values) if is_log else values * factor * 10.0**-power)

    frame = Frame(box, (0.0, 1.0), span(scaled(low), scaled(high)))
    words = _decade_words(*frame.y_range) if is_log else tick_words(*frame.y_range)
    label = f"{name} [{scaled_unit(unit, power)}]"
    body = framed(frame, words, label, at=12)
    if spread.median is not None and (not is_log or spread.median > 0.0):
        at = float(frame.y(scaled(np.array([spread.median])))[0])
        body += f'<path class="zero" d="M{_LEFT:.1f} {at:.1f}H{_LEFT + _WIDTH:.1f}"/>'
    loud = [mark.is_outlier for mark in marks]
    lower, centre, upper = (frame.y(scaled(values)) for values in (low, middle, high))
    body += _bars(across, lower, centre, upper, loud)
    shift = min(_SHIFT, 0.3 * _WIDTH / len(marks))
    stems = [
        f"M{x + shift:.1f} {bottom:.1f}V{top:.1f}"
        for x, mark in zip(across, marks, strict=True)
        if mark.pooled is not None
        for bottom, top in [frame.y(scaled(np.array([mark.pooled[0], mark.pooled[2]])))]
    ]
    return body + (f'<path class="stem pooled" d="{"".join(stems)}"/>' if stems else "")


def _changes(name: str, unit: str, marks: Sequence[Mark], across: Array, top: float) -> str:
    """Changes since the last refit with their 90 % intervals; significant ones are highlighted."""
    is_relative = name in POSITIVE
    values, halves = [], []
    for mark in marks:
        absolute = mark.drift.absolute if mark.drift else None
        size = mark.drift.relative if mark.drift and is_relative else absolute
        share = abs(size / absolute) if size and absolute else 0.0
        values.append(math.nan if size is None else float(size))
        halves.append(_NORMAL_90 * mark.change_sd * share)
    middle, half = np.array(values), np.array(halves)
    largest = float(np.nanmax(np.abs(middle) + half)) if np.isfinite(middle).any() else 0.0
    factor = 100.0 if is_relative else 10.0 ** -unit_power(largest)
    limits = span((middle - half) * factor, (middle + half) * factor, [0.0])
    frame = Frame((_LEFT, top, _WIDTH, _CHANGES), (0.0, 1.0), limits)
    shown = "%" if is_relative else scaled_unit(unit, unit_power(largest))
    body = framed(frame, tick_words(*limits, 4), f"change [{shown}]", at=12)
    zero = float(frame.y(0.0))
    body += f'<path class="zero" d="M{_LEFT:.1f} {zero:.1f}H{_LEFT + _WIDTH:.1f}"/>'
    loud = [mark.is_significant for mark in marks]
    low, high = (frame.y((middle + sign * half) * factor) for sign in (-1.0, 1.0))
    return body + _bars(across, low, frame.y(middle * factor), high, loud)


def _decade_words(low: float, high: float) -> list[tuple[float, str]]:
    """Tick labels of a logarithmic axis: 1, 2 and 5 times powers of ten, or powers of ten only."""
    factors = (1.0, 2.0, 5.0) if high - low < 2.5 else (1.0,)
    values = [
        math.log10(factor) + power
        for power in range(math.floor(low), math.ceil(high) + 1)
        for factor in factors
    ]
    return [(value, number_text(10.0**value, 1)) for value in values if low <= value <= high]


def _bars(across: Array, low: Array, middle: Array, high: Array, loud: Sequence[bool]) -> str:
    """Vertical intervals with a dot at the median, normal motors first, highlighted ones on top."""
    body = ""
    for is_loud in (False, True):
        stems, dots = [], []
        for index, x in enumerate(across):
            if loud[index] is is_loud and math.isfinite(middle[index]):
                stems.append(f"M{x:.1f} {low[index]:.1f}V{high[index]:.1f}")
                dots.append(f"M{x:.1f} {middle[index]:.1f}h0")
        kind = " loud" if is_loud else ""
        if stems:
            body += f'<path class="stem{kind}" d="{"".join(stems)}"/>'
            body += f'<path class="dots few{kind}" d="{"".join(dots)}"/>'
    return body


def _names(marks: Sequence[Mark], across: Array, bottom: float) -> tuple[str, float]:
    """Motor names below the frame, and their height; in a large fleet, highlighted motors only."""
    loud = [index for index, mark in enumerate(marks) if mark.is_outlier or mark.is_significant]
    wanted = loud + (list(range(len(marks))) if len(marks) <= _MOST_NAMED else [])
    placed: list[float] = []
    parts = []
    longest = 0.0
    for index in wanted:
        x = float(across[index])
        if all(abs(x - other) >= _APART for other in placed):
            placed.append(x)
            name = marks[index].motor
            short = name if len(name) <= _LONGEST_NAME else f"{name[: _LONGEST_NAME - 1]}…"
            wide = sum(letter in "mwMW@%" for letter in short)
            longest = max(longest, _LETTER * (len(short) - wide) + _WIDE_LETTER * wide)
            kind = "tick end strong" if index in loud else "tick end"
            parts.append(text(x + 3.5, bottom + 6, short, kind, turned=True))
    return "".join(parts), longest


def _hovers(marks: Sequence[Mark], across: Array, bottom: float, unit: str) -> str:
    """Tooltip of each motor: value, score and drift."""
    width = _WIDTH / len(marks)
    parts = []
    for mark, x in zip(marks, across, strict=True):
        value = interval_text(mark.median, mark.q05, mark.q95)
        title = f"{mark.motor}: {value.median} ({value.low} … {value.high}){value.power} "
        title += unit_text(unit)
        if mark.score is not None:
            title += f"; {mark.score:+.1f} robust sd from the fleet median"
        if mark.drift is not None and mark.drift.sds is not None:
            title += f"; drift {mark.drift.sds:+.1f} combined sd"
        parts.append(
            f'<rect class="hover" x="{x - width / 2:.2f}" y="{_TOP:.1f}" width="{width:.2f}" '
            f'height="{bottom - _TOP:.1f}"><title>{escape(title)}</title></rect>'
        )
    return "".join(parts)


_BOX = (92.0, 10.0, 358.0, 150.0)
_MOST_LABELS = 4
_LABEL, _PER_LETTER = 30.0, 9.6


def history_figure(
    name: str, refits: Sequence[Refit], changes: Sequence[dict[str, Drift]], times: Sequence[str]
) -> str:
    """SVG of medians with 90 % intervals over fits, oldest first; empty if none identifies it.

    Significant changes against the fit before are highlighted.  The times of the fits are UTC, ISO
    8601; the drawing shows their dates, and keeps the times for the script of a page.
    """
    unit = DECLARED_PARAMETERS[name].unit
    shown = [
        (index, one.q05, one.median, one.q95)
        for index, refit in enumerate(refits)
        if (one := refit.estimates.get(name)) and one.usable and None not in (one.q05, one.q95)
    ]
    if not shown:
        return ""
    places, low, middle, high = np.array(shown, dtype=np.float64).T
    largest = float(np.abs([low, high]).max())
    factor, unit = unit_prefix(unit, [largest])
    power = unit_power(factor * largest)
    scale = factor * 10.0**-power
    heights = span(scale * low, scale * high, margin=0.12)
    words = tick_words(*heights, 4)
    # Room for the longest tick label beside the label of the axis.
    left = max(_BOX[0], _LABEL + _PER_LETTER * max(len(word) for _, word in words))
    box = (left, _BOX[1], _BOX[0] + _BOX[2] - left, _BOX[3])
    frame = Frame(box, (-0.5, len(refits) - 0.5), heights)
    # A date at each fit, or at some of many.
    below = "".join(
        text(float(frame.x(k)), _BOX[1] + _BOX[3] + 14, times[k][:10], "tick mid", time=times[k])
        for k in range(0, len(times), -(-len(times) // _MOST_LABELS))
    )
    body = framed(frame, words, f"{name} [{scaled_unit(unit, power)}]", below)
    across = frame.x(places)
    body += path(across, frame.y(scale * middle), "zero")
    drifted = [changes[int(place)].get(name) for place in places]
    loud = [drift is not None and drift.is_significant is True for drift in drifted]
    bottom, centre, top = (frame.y(scale * values) for values in (low, middle, high))
    body += _bars(across, bottom, centre, top, loud)
    described = (
        f"{len(shown)} fits, from {number_text(float(middle[0]))} to "
        f"{number_text(float(middle[-1]))} {unit}, medians with 90 % intervals."
    )
    return svg(460, 190, f"{name} over the fits", described, body)
