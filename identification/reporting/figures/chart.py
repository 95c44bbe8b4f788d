"""Charts as data for uPlot: the script of the page draws them in the width and theme of the screen.

    chart("Trace of J", "600 steps.", ("step", "J [kg m^2]"), [Line("median", "after", x, y)])

The element of a chart carries its title and description for screen readers, and its data in a block
that is never executed.  Marks have a kind and no colour; the style sheet has one colour per kind.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import ArrayLike

from identification.arrays import Array

__all__ = ["Band", "Line", "chart", "script_json"]

_LARGEST: Final = 1e30
"""Largest magnitude that is plotted; larger ones, as of a diverging simulation, are missing."""

Mark = Literal["line", "thin", "dashed", "dots", "few", "stems", "bars"]


@dataclass(frozen=True, eq=False)
class Line:
    """One series of a chart."""

    label: str
    """Text in the key; a series without a label has no key."""
    kind: str
    """Colour, by its name in the style sheet."""
    x: ArrayLike
    """(n_point,) increasing."""
    y: ArrayLike
    """(n_point,) values; not finite where the line breaks."""
    mark: Mark = "line"
    """How the points are drawn; ``bars`` have a scale of their own at the bottom."""


@dataclass(frozen=True, eq=False)
class Band:
    """Area between two curves."""

    kind: str
    """Colour, by its name in the style sheet."""
    x: ArrayLike
    """(n_point,) increasing."""
    low: ArrayLike
    """(n_point,) lower end."""
    high: ArrayLike
    """(n_point,) upper end."""


def chart(
    title: str,
    description: str,
    labels: tuple[str, str],
    lines: Sequence[Line],
    bands: Sequence[Band] = (),
    *,
    y_range: tuple[float, float] | None = None,
    height: int = 230,
) -> str:
    """Element of a chart of lines over bands.

    A screen reader reads out title and description, one sentence with the key numbers.  The range
    of the vertical axis is by default that of all values, the height is in px.

    Raises:
        ValueError: No value is finite.
    """
    spec: dict[str, Any] = {
        "x": labels[0],
        "y": labels[1],
        "height": height,
        "range": None if y_range is None else _numbers(y_range),
        "lines": [
            {"label": one.label, "kind": one.kind, "mark": one.mark}
            | {"x": _numbers(one.x), "y": _numbers(one.y)}
            for one in lines
        ],
        "bands": [
            {"kind": one.kind, "x": _numbers(one.x)}
            | {"low": _numbers(one.low), "high": _numbers(one.high)}
            for one in bands
        ],
    }
    seen = [spec["range"] or [0], *(line["y"] for line in spec["lines"])]
    if None in seen[0] or all(value is None for values in seen[1:] for value in values):
        raise ValueError("no value is finite")
    words = escape(f"{title}. {description}")
    return (
        f'<div class="chart" role="img" aria-label="{words}">'
        f'<script type="application/json">{script_json(spec)}</script></div>'
    )


def script_json(content: object) -> Markup:
    """JSON that cannot end the block of a page that holds it."""
    text = json.dumps(content, allow_nan=False, separators=(",", ":"), ensure_ascii=True)
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))


def _numbers(values: ArrayLike) -> list[float | None]:
    """Values to 1/10,000 of their range, None where not finite or too large to plot."""
    array: Array = np.asarray(values, dtype=np.float64)
    shown = np.abs(array) < _LARGEST
    span = float(np.ptp(array[shown])) if shown.any() else 0.0
    decimals = 4 - math.floor(math.log10(span)) if 1e-15 < span < 1e15 else None
    return [
        (value if decimals is None else round(value, decimals)) if is_shown else None
        for value, is_shown in zip(array.tolist(), shown.tolist(), strict=True)
    ]
