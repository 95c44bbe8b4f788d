"""Charts drawn as SVG, for pages that need no script.

    drawn_chart(step_figure(steps))
    for figure in report_figures(text, "missing"):
        figure.svg, figure.caption

A finished report contains text of strangers and runs in a sandbox.  A page that shows its charts
does not, so they are drawn anew from their data, a block of JSON: only numbers, known marks and
escaped text reach the drawing.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from markupsafe import Markup

from identification.arrays import Array
from identification.reporting.svg import Frame, axes, band, dots, line, path, span, svg, text

__all__ = ["ReportFigure", "drawn_chart", "report_figures"]

_CHART: Final = re.compile(
    r'<div class="chart" role="img" aria-label="(?P<words>[^"]*)">'
    r'<script type="application/json">(?P<spec>[^<]*)</script></div>'
)
_SECTION: Final = '<section id="{}">(.*?)</section>'
_FIGURE: Final = re.compile(
    rf'<figure(?: class="(?P<kind>[a-z ]*)")?>\s*(?P<chart>{_CHART.pattern})\s*'
    r"<figcaption>(?P<caption>.*?)</figcaption>",
    re.DOTALL,
)
_KIND: Final = re.compile(r"[a-z]+[0-9]?")
_LEFT, _RIGHT, _TOP, _BOTTOM = 80.0, 10.0, 10.0, 42.0
_KEY: Final = 18.0
_PER_LETTER: Final = 9.5
"""Width of a letter of the key in bold where the page shows the drawing small [drawing units]."""
_BARS: Final = 0.14
"""Height of the tallest bar over that of the plot."""


def drawn_chart(element: str, width: float = 460.0) -> str:
    """SVG of an element that `chart` returns, of this width [drawing units].

    Raises:
        ValueError: The element is not a chart, or its data are not plottable.
    """
    found = _CHART.fullmatch(element)
    if found is None:
        raise ValueError("not the element of a chart")
    try:
        spec = json.loads(found["spec"])
        return _drawn(spec, html.unescape(found["words"]), width)
    except (KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError("the data of the chart are incomplete") from error


@dataclass(frozen=True)
class ReportFigure:
    """One figure of a report."""

    svg: Markup
    """SVG element; its classes are those of the style sheet of the page."""
    caption: str
    is_wide: bool
    """True for a figure as wide as the page."""


def report_figures(text: str, section: str) -> list[ReportFigure]:
    """Charts of the section of a report with an id, in their order; empty if it has none.

    The section is ``missing`` for the evidence of the effects, ``summary`` for the first screen,
    ``loop`` for the step responses.  Charts that cannot be drawn are omitted.
    """
    found = re.search(_SECTION.format(re.escape(section)), text, re.DOTALL)
    figures = []
    for match in _FIGURE.finditer(found.group(1)) if found else ():
        is_wide = match["kind"] == "wide"
        try:
            drawn = drawn_chart(match["chart"], 920.0 if is_wide else 460.0)
        except ValueError:
            continue
        svg = Markup(drawn)  # noqa: S704  text is escaped where it is drawn
        figures.append(ReportFigure(svg, html.unescape(match["caption"]), is_wide))
    return figures


def _drawn(spec: Mapping[str, Any], words: str, width: float) -> str:
    title, _, description = words.partition(". ")
    labels = [
        (f"{'‒ ‒' if one['mark'] == 'dashed' else '—'} {one['label']}", _kind(one))
        for one in spec["lines"]
        if one["label"]
    ]
    keys = _rows(labels, width - _RIGHT)
    key = _KEY * len(keys)
    height = min(float(spec["height"]), 400.0) - _BOTTOM
    box = (_LEFT, _TOP + key, width - _LEFT - _RIGHT, height)
    series = [*spec["lines"], *spec["bands"]]
    has_dots = any(one["mark"] in ("dots", "few") for one in spec["lines"])
    across = span(*(_array(one["x"]) for one in series), margin=0.03 if has_dots else 0.0)
    frame = Frame(box, across, _y_range(spec))
    body = axes(frame, str(spec["x"]), str(spec["y"]), (10 if width > 600.0 else 6, 5))
    for one in spec["bands"]:
        low, high = _array(one["low"]), _array(one["high"])
        body += band(frame, _array(one["x"]), low, high, f"band {_kind(one)}")
    body += "".join(_mark(frame, one) for one in spec["lines"])
    # Each label above the plot in the colour of its series.
    body += "".join(
        text(at, _TOP + 4.0 + _KEY * row, label, f"tick strong {kind}")
        for row, placed in enumerate(keys)
        for at, label, kind in placed
    )
    return svg(width, height + key + _TOP + _BOTTOM, title, description, body)


def _mark(frame: Frame, one: Mapping[str, Any]) -> str:
    x, y, kind = _array(one["x"]), _array(one["y"]), _kind(one)
    match one["mark"]:
        case "dots":
            return dots(frame, x, y, f"dots {kind}")
        case "few":
            return dots(frame, x, y, "dots few")
        case "stems":
            return "".join(
                line(frame, np.full(2, at), np.array([0.0, value]), f"stem {kind}")
                for at, value in zip(x, y, strict=True)
            )
        case "bars":
            return _bars(frame, x, y)
        case "thin" | "dashed" as mark:
            return line(frame, x, y, f"line {kind} {mark}")
        case _:
            return line(frame, x, y, f"line {kind}")


def _bars(frame: Frame, x: Array, y: Array) -> str:
    """Bars from the bottom of the plot, on a scale of their own."""
    _, top, _, height = frame.box
    if x.size < 2:
        return ""
    half = 0.5 * float(frame.x(x[1]) - frame.x(x[0]))
    marks = ""
    for middle, value in zip(frame.x(x), y / max(float(np.nanmax(y)), 1e-12), strict=True):
        if value > 0.0:
            across = np.array([middle - half, middle - half, middle + half, middle + half])
            tall = _BARS * height * np.array([0.0, value, value, 0.0])
            marks += path(across, top + height - tall, "bars", closed=True)
    return marks


def _rows(labels: list[tuple[str, str]], right: float) -> list[list[tuple[float, str, str]]]:
    """Rows of the key: the start of each label, the label with its line, and its kind."""
    rows: list[list[tuple[float, str, str]]] = []
    at = right
    for label, kind in labels:
        wide = _PER_LETTER * (len(label) + 1)
        if not rows or at + wide > right:
            rows.append([])
            at = _LEFT
        rows[-1].append((at, label, kind))
        at += wide
    return rows


def _y_range(spec: Mapping[str, Any]) -> tuple[float, float]:
    if spec["range"] is not None:
        low, high = spec["range"]
        return float(low), float(high)
    values = [_array(one["y"]) for one in spec["lines"] if one["mark"] != "bars"]
    values += [_array(one[end]) for one in spec["bands"] for end in ("low", "high")]
    return span(*values)


def _array(values: Any) -> Array:
    """(n_point,) numbers, NaN where the list has none."""
    array = np.array(values, dtype=np.float64)
    if array.ndim != 1:
        raise ValueError("a series is not a list of numbers")
    return array


def _kind(one: Mapping[str, Any]) -> str:
    kind = str(one["kind"])
    if not _KIND.fullmatch(kind):
        raise ValueError("a colour has an unknown name")
    return kind
