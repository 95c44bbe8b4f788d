"""SVG drawings as text: a frame that maps data to drawing coordinates, ticks, paths and words.

    frame = Frame((52, 8, 400, 180), (0.0, 1.0), (0.0, 2.0))
    svg(460, 220, title, description, axes(frame, "time [s]", "speed [rad/s]") + line(frame, x, y))

uPlot draws the charts of the report; these functions draw what has to work without a script: the
corner plot, the fleet, the pages of the service and the plots of the documentation.

Marks have a class and no colour; the style sheet of the report colours each class for light, dark
and print.  Text is escaped here because it includes file names.
"""

from __future__ import annotations

import html
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from identification.arrays import Array, stretches
from identification.result.numbers import number_text

__all__ = [
    "Frame",
    "axes",
    "band",
    "dots",
    "framed",
    "line",
    "path",
    "span",
    "svg",
    "svg_file",
    "text",
    "tick_words",
    "ticks",
]

_LARGEST: Final = 1e300
_LEAST: Final = 1e-300
"""Largest axis limit and smallest axis width that cause neither overflow nor underflow."""
_FINEST: Final = 1e15
"""Axis limit over tick step above which rounding hides the step."""
_FAR: Final = 1e5
"""Largest coordinate drawn [drawing units]; lines are clipped to it, dots and text beyond it
omitted."""

_identifiers: Iterator[int] = itertools.count(1)


@dataclass(frozen=True)
class Frame:
    """Rectangle of the drawing that shows a range of the data.

    Raises:
        ValueError: A range is not finite.
    """

    box: tuple[float, float, float, float]
    """Left, top, width and height in drawing units."""
    x_range: tuple[float, float]
    """Data values at the left and right edge."""
    y_range: tuple[float, float]
    """Data values at the bottom and top edge."""

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.x_range, *self.y_range))):
            raise ValueError(f"its axes would span {self.x_range} and {self.y_range}")

    def x(self, values: ArrayLike) -> Array:
        """Horizontal drawing coordinates of data, same shape."""
        left, _, width, _ = self.box
        return left + width * _share(values, self.x_range)

    def y(self, values: ArrayLike) -> Array:
        """Vertical drawing coordinates of data, same shape; larger values are higher."""
        _, top, _, height = self.box
        return top + height * (1.0 - _share(values, self.y_range))


def span(*arrays: ArrayLike, margin: float = 0.05) -> tuple[float, float]:
    """Range of all finite values of the arrays, widened on both sides by the fraction `margin`."""
    values = np.concatenate([np.ravel(np.asarray(array, dtype=np.float64)) for array in arrays])
    values = values[np.isfinite(values)]
    if values.size == 0:
        return (0.0, 1.0)
    low, high = np.clip([values.min(), values.max()], -_LARGEST, _LARGEST).tolist()
    room = margin * (high - low) if high > low else 0.05 * abs(high) or 0.5
    if high - low + 2.0 * room < _LEAST:
        # Subnormal numbers: the reciprocal of their tick step overflows.
        return (low - 0.5, high + 0.5)
    return (low - room, high + room)


def ticks(low: float, high: float, about: int = 5) -> Array:
    """Round numbers (n_tick,) from `low` to `high`, in steps of 1, 2 or 5 times a power of ten."""
    if not high > low:
        return np.array([low])
    raw = (high - low) / max(about, 1)
    ten = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * ten for factor in (1.0, 2.0, 5.0, 10.0) if factor * ten >= raw * 0.999)
    if max(abs(low), abs(high)) > _FINEST * step:
        return np.array([low])
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return np.asarray(np.arange(first, last + 1) * step, dtype=np.float64)


def tick_words(low: float, high: float, about: int = 5) -> list[tuple[float, str]]:
    """Tick values and labels, at least two if possible, with enough digits to tell them apart."""
    values = ticks(low, high, about)
    while values.size < 2 and high > low and about < 40:
        # A single tick label gives no scale.
        about *= 2
        values = ticks(low, high, about)
    largest = max(abs(low), abs(high))
    if not 1e-4 <= largest < 1e5:
        return [(value, "0" if value == 0.0 else number_text(value, 3)) for value in values]
    step = float(values[1] - values[0]) if values.size > 1 else high - low
    decimals = max(0, -math.floor(math.log10(step) + 1e-9)) if step > 0.0 else 3
    return [
        (value, "0" if value == 0.0 else f"{value:.{decimals}f}".replace("-", "−"))
        for value in values
    ]


def svg(width: float, height: float, title: str, description: str, body: str) -> str:
    """Complete SVG element [drawing units] that scales with its container.

    A screen reader reads out title and description.
    """
    key = f"svg{next(_identifiers)}"
    title, description = (html.escape(text, quote=False) for text in (title, description))
    return (
        f'<svg viewBox="0 0 {width:g} {height:g}" width="{width:g}" role="img" '
        f'aria-labelledby="{key}t {key}d">'
        f'<title id="{key}t">{title}</title><desc id="{key}d">{description}</desc>'
        f"{body}</svg>"
    )


def svg_file(drawing: str, style: str) -> str:
    """Content of a file with one SVG element and its style, CSS without the tags."""
    tagged = drawing.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1)
    return tagged.replace(">", f"><style>{style}</style>", 1) + "\n"


def path(x: Array, y: Array, kind: str, closed: bool = False) -> str:
    """Polyline through drawing coordinates, interrupted where a coordinate is not finite."""
    pieces = []
    finite = np.isfinite(x) & np.isfinite(y)
    x, y = np.clip(x, -_FAR, _FAR), np.clip(y, -_FAR, _FAR)
    for first, last in stretches(finite):
        points = " ".join(f"{a:.1f} {b:.1f}" for a, b in zip(x[first:last], y[first:last]))  # noqa: B905
        pieces.append(f"M{points}{'Z' if closed else ''}")
    return f'<path class="{kind}" d="{"".join(pieces)}"/>' if pieces else ""


def line(frame: Frame, x: ArrayLike, y: ArrayLike, kind: str = "line") -> str:
    """Line through data (n_point,)."""
    return path(frame.x(x), frame.y(y), kind)


def band(frame: Frame, x: ArrayLike, low: ArrayLike, high: ArrayLike, kind: str = "band") -> str:
    """Area between two curves over the same x, (n_point,) each."""
    across = frame.x(x)
    return path(
        np.concatenate([across, across[::-1]]),
        np.concatenate([frame.y(low), frame.y(high)[::-1]]),
        kind,
        closed=True,
    )


def dots(frame: Frame, x: ArrayLike, y: ArrayLike, kind: str = "dots") -> str:
    """Points (n_point,) as one path of zero-length strokes, which round caps turn into dots."""
    places = np.column_stack([frame.x(x), frame.y(y)])
    seen = (np.abs(places) <= _FAR).all(axis=1)
    marks = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in places[seen])
    return f'<path class="{kind}" d="{marks}"/>' if marks else ""


def text(
    x: float, y: float, content: str, kind: str = "tick", turned: bool = False, time: str = ""
) -> str:
    """Text at a point of the drawing, vertical if `turned`; empty if the point is not visible.

    A script of the page replaces the text by the local `time`, ISO 8601 in UTC.
    """
    if not (abs(x) <= _FAR and abs(y) <= _FAR):
        return ""
    turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
    moment = f' data-time="{html.escape(time)}"' if time else ""
    words = html.escape(content, quote=False)
    return f'<text class="{kind}"{moment} x="{x:.1f}" y="{y:.1f}"{turn}>{words}</text>'


def axes(frame: Frame, x_label: str, y_label: str, about: tuple[int, int] = (6, 5)) -> str:
    """Frame with grid, tick labels and axis labels; `about` so many ticks along x and y.

    An empty label of x omits its tick labels as well.
    """
    left, top, width, height = frame.box
    bottom = top + height
    parts = []
    for value, word in tick_words(*frame.x_range, about[0]):
        at = float(frame.x(value))
        parts.append(f'<path class="grid" d="M{at:.1f} {top:.1f}V{bottom:.1f}"/>')
        if x_label:
            parts.append(text(at, bottom + 14, word, "tick mid"))
    if x_label:
        parts.append(text(left + width / 2, bottom + 31, x_label, "label mid"))
    return framed(frame, tick_words(*frame.y_range, about[1]), y_label, "".join(parts))


def framed(
    frame: Frame, words: Sequence[tuple[float, str]], label: str, below: str = "", at: float = 15
) -> str:
    """Frame with the grid, tick labels and label of its vertical axis, and what stands below it."""
    left, top, width, height = frame.box
    parts = [f'<rect class="frame" x="{left}" y="{top}" width="{width}" height="{height}"/>']
    for value, word in words:
        y = float(frame.y(value))
        parts.append(f'<path class="grid" d="M{left:.1f} {y:.1f}H{left + width:.1f}"/>')
        parts.append(text(left - 6, y + 4, word, "tick end"))
    parts.append(below)
    if label:
        parts.append(text(at, top + height / 2, label, "label mid", turned=True))
    return "".join(parts)


def _share(values: ArrayLike, limits: tuple[float, float]) -> Array:
    low, high = limits
    return np.asarray((np.asarray(values, dtype=np.float64) - low) / ((high - low) or 1.0))
