"""Plots of cost against rows and against effects, as SVG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from benchmarks.peers.statistics import Line, median, of, seconds_per_thousand
from identification.reporting.svg import Frame, axes, dots, line, span, svg, svg_file, text

__all__ = ["costs_by_rows", "plots"]

_COLOURS: Final = ("#1e88e5", "#d81b60", "#e08700", "#00897b", "#8e24aa", "#6d4c41", "#546e7a")
_STYLE: Final = (
    "text{font:11px sans-serif;fill:#777}.mid{text-anchor:middle}.end{text-anchor:end}"
    ".frame{fill:none;stroke:#999}.grid{stroke:#9993}"
    + "".join(
        f".s{k}{{fill:none;stroke:{c};stroke-width:1.6}}.d{k}{{stroke:{c};stroke-width:6;stroke-linecap:round}}"
        for k, c in enumerate(_COLOURS)
    )
)
_WIDTH, _HEIGHT = 640.0, 330.0

Series = Mapping[str, tuple[Sequence[float], Sequence[float]]]


def costs_by_rows(lines: Sequence[Line]) -> dict[str, tuple[list[float], list[float]]]:
    """Rows and processor seconds of each program: 1,000 effective samples, a fit, a whole loop."""
    found: dict[str, tuple[list[float], list[float]]] = {}
    kinds = {
        "posterior": ("1,000 effective samples", seconds_per_thousand),
        "fit": ("fit", lambda some: median(some, lambda x: x["cpu"]["fit"])),
        "loop": ("whole loop", lambda some: median(some, lambda x: x["cpu"]["loop"])),
    }
    for part, (words, cost) in kinds.items():
        for name in dict.fromkeys(each["name"] for each in of(lines, part)):
            if name.endswith("L-BFGS-B"):
                continue  # measured for one size only
            sizes = sorted({each["rows"] for each in of(lines, part, name)})
            costs = [cost(of(lines, part, name, rows)) for rows in sizes]
            found[f"{name}: {words}"] = ([float(n) for n in sizes], costs)
    return found


def plots(lines: Sequence[Line]) -> dict[str, str]:
    """SVG text of each plot, by file name."""
    found = costs_by_rows(lines)
    drawn: dict[str, str] = {}
    for file, words, title in (
        ("posterior.svg", "1,000 effective samples", "Time of 1,000 effective samples"),
        ("identification.svg", "", "Time of a fit and of a whole loop"),
    ):
        chosen = {
            name: series
            for name, series in found.items()
            if (words and name.endswith(words)) or (not words and "effective" not in name)
        }
        if chosen:
            logs = {n: (np.log10(x).tolist(), np.log10(y).tolist()) for n, (x, y) in chosen.items()}
            drawn[file] = _plot(title, logs, "log10 of the rows", "log10 of processor time [s]")
    models = [model for each in of(lines, "effects") for model in each["models"]]
    if models:
        count = [float(k) for k in range(len(models))]
        drawn["effects.svg"] = _plot(
            "Time of one likelihood with 0 to 5 effects",
            {"motorid": (count, [model["ns"] for model in models])},
            "effects in the model",
            "processor time per row and walker [ns]",
        )
    return drawn


def _plot(title: str, series: Series, x_label: str, y_label: str) -> str:
    xs, ys = (np.concatenate([each[k] for each in series.values()]) for k in range(2))
    frame = Frame((56.0, 12.0, 330.0, 270.0), span(xs, margin=0.08), span(ys, margin=0.08))
    parts = [axes(frame, x_label, y_label)]
    for k, (name, (x, y)) in enumerate(series.items()):
        k %= len(_COLOURS)
        parts += [line(frame, x, y, f"s{k}"), dots(frame, x, y, f"d{k}")]
        height = 26.0 + 17.0 * k
        parts.append(f'<path class="s{k}" d="M398 {height - 4:g}h18"/>')
        parts.append(text(421.0, height, name, "label"))
    drawing = svg(_WIDTH, _HEIGHT, title, f"{y_label} over {x_label}.", "".join(parts))
    return svg_file(drawing, _STYLE)
