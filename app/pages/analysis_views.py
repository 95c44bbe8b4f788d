"""Views of analyses: speed loop, tuning, predicted run, next run, and fits of a motor over time."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from app.pages.forms import FIELDS
from identification.result.attempts import figure
from identification.result.effect_texts import effect_words
from identification.result.numbers import (
    UNKNOWN,
    listed,
    number_text,
    percent_text,
    unit_prefix,
    unit_text,
    with_symbols,
)

if TYPE_CHECKING:
    from app.analyses.prediction import Design, Prediction
    from app.analyses.service import LoopAnalysis
    from app.tables import RunRow
    from identification.fleet.explanation import Explanation
    from identification.fleet.refit import Refit

__all__ = ["by_motor", "design_view", "history_view", "loop_view", "prediction_view", "tuning_view"]

_METRICS: Final = tuple(FIELDS)[:6]
_WIDE: Final = 920.0
"""Width of a figure that spans the page [drawing units]."""


def loop_view(loop: LoopAnalysis, result: Mapping[str, Any]) -> dict[str, Any]:
    """View of a speed loop: the figure and the table of the report."""
    # Lazy imports, here and below: scipy would slow down every start.
    from identification.reporting.figures.curves import step_figure
    from identification.reporting.figures.drawn import drawn_chart
    from identification.reporting.tables import feedback_tables

    return {
        "figure": figure("step response", lambda: drawn_chart(step_figure(loop.steps))),
        "tables": feedback_tables(loop.feedback),
        "effects": listed([effect_words(e["name"]) for e in result.get("effects") or ()]),
        "remarks": loop.remarks,
    }


def tuning_view(found: Mapping[str, Any], remarks: tuple[str, ...]) -> dict[str, Any]:
    """View of the first controller of a tuning: statement, step response and metrics."""
    from identification.reporting.figures.curves import step_figure
    from identification.reporting.figures.drawn import drawn_chart
    from identification.speed_loop import StepCurve

    entry, step = found["controllers"][0], found["step_rad_s"]
    steps = [
        StepCurve(
            response["temperature_degC"],
            entry["controller"],
            np.array(response["time_s"]),
            *(np.array(response["speed"][name]) / step for name in ("median", "q05", "q95")),
        )
        for response in entry["responses"]
    ]
    rows = [
        _metric_row(name, entry["temperatures"], found["specification"][name]) for name in _METRICS
    ]
    return {
        "controller": entry["controller"],
        "meets": entry["meets"],
        "probability": f"{100 * entry['probability']:.3g} %",
        "statement": entry["statement"],
        "step": f"{step:g}",
        "draws": found["draws"],
        "figure": figure("step response", lambda: drawn_chart(step_figure(steps))),
        "temperatures": [f"{at['temperature_degC']:g} °C" for at in entry["temperatures"]],
        "rows": rows,
        "effects": listed([effect_words(name) for name in found["effects"]]),
        "remarks": remarks,
    }


def _unbroken(value: float) -> str:
    """Text of a number without a place for a line break."""
    return number_text(value).replace(" ", "\u00a0")


def _metric_row(
    name: str, temperatures: Sequence[Mapping[str, Any]], limit: float | None
) -> tuple[str, str, float | None, list[tuple[str, float | None]]]:
    """Label, unit, limit and cells of one metric, with the 90 % interval at each temperature."""
    label, unit = FIELDS[name]
    ends = [(at[name]["q05"], at[name]["q95"]) for at in temperatures]
    factor, unit = unit_prefix(unit, [limit, *(end for pair in ends for end in pair)])
    cells = []
    for at, pair in zip(temperatures, ends, strict=True):
        known = [factor * end for end in pair if end is not None]
        texts = list(dict.fromkeys(map(_unbroken, known))) if len(known) == 2 else []
        cells.append((" to ".join(texts) or UNKNOWN, at[name].get("met_probability")))
    return label, unit, None if limit is None else factor * limit, cells


def by_motor(runs: Sequence[RunRow], motor: str | None) -> list[RunRow]:
    """Runs of this motor first, then those of the others by name, and those without a name last."""
    return sorted(runs, key=lambda run: (run.motor != motor, run.motor is None, run.motor or ""))


def prediction_view(name: str, prediction: Prediction) -> dict[str, Any]:
    """Figure and table of a prediction."""
    from identification.reporting.figures.curves import prediction_figure
    from identification.reporting.figures.drawn import drawn_chart

    plot = prediction.plot

    def drawn(channel: Literal["speed", "current"]) -> str:
        time, measured, simulated = np.array([plot["time"], *plot[channel]], dtype=np.float64)
        return drawn_chart(prediction_figure(name, channel, time, (measured, simulated)), _WIDE)

    rows = []
    for channel, unit in (("current", "A"), ("speed", "rad/s")):
        found: Mapping[str, float | None] = prediction.errors[channel]
        nrmse = found["nrmse"]
        rows.append(
            {
                "channel": channel,
                "rmse": number_text(found["rmse"], 3),
                "unit": unit,
                "fit": percent_text(None if nrmse is None else 1.0 - nrmse, 4),
                "ratio": number_text(found["noise_ratio"], 3),
            }
        )
    figures = [figure(f"predicted {channel}", drawn, channel) for channel in ("speed", "current")]
    return {"figures": figures, "rows": rows, "remarks": prediction.remarks}


def design_view(design: Design) -> dict[str, Any]:
    """Plot of the voltage of a designed run, its expected gain, and the widths of the intervals.

    The rows have name, unit, value, and width now and after the run of each parameter, as text.
    """
    from identification.reporting.figures.curves import profile_figure
    from identification.reporting.figures.drawn import drawn_chart

    table = np.loadtxt(io.StringIO(design.table), delimiter=",", skiprows=1, usecols=(0, 1))
    time, voltage = table.T
    return {
        "figure": figure("proposed run", lambda: drawn_chart(profile_figure(time, voltage), _WIDE)),
        "summary": [with_symbols(text) for text in design.entry["summary"]],
        "widths": [_width_row(*item) for item in design.entry["parameters"].items()],
    }


def _width_row(name: str, entry: Mapping[str, Any]) -> tuple[str, ...]:
    widths = [entry["width_before"], entry["width_after"]]
    factor, unit = unit_prefix(entry["unit"], [entry["value"], *widths])
    value, *widths = (size if size is None else factor * size for size in (entry["value"], *widths))
    return name, unit_text(unit), number_text(value), *(number_text(size, 3) for size in widths)


def history_view(refits: Sequence[Refit], requested_at: Mapping[str, str]) -> dict[str, Any]:
    """Plots of the parameters over the fits of one motor, and a row for each fit.

    The refits are the newest first; the times of the requests are UTC, ISO 8601, by ID.
    """
    from identification.fleet.drift import drifts
    from identification.fleet.explanation import explanations
    from identification.fleet.figure import history_figure
    from identification.fleet.refit import compared_with
    from identification.quantities import DECLARED_PARAMETERS

    oldest_first = [refit for refit in reversed(refits) if refit.estimates]
    compared: list[Refit] = []
    last: dict[bool, Refit] = {}
    for refit in oldest_first:
        compared.append(compared_with(refit, last.get(refit.is_searched)))
        last[refit.is_searched] = refit
    changes = drifts(compared)
    causes = explanations(compared)
    times = [requested_at[refit.fit] for refit in compared]
    drawn = [
        figure(f"history of {name}", history_figure, name, compared, changes, times)
        for name in DECLARED_PARAMETERS
    ]
    return {
        "figures": [
            {"svg": svg, "caption": with_symbols(parameter.meaning)}
            for svg, parameter in zip(drawn, DECLARED_PARAMETERS.values(), strict=True)
            if svg
        ],
        "rows": {
            refit.fit: {
                **_fit_row(refit, [n for n, drift in moved.items() if drift.is_significant]),
                "causes": _causes(explanation),
            }
            for refit, moved, explanation in zip(compared, changes, causes, strict=True)
        },
    }


def _causes(explanation: Explanation | None) -> str:
    """Probable causes of the change since the fit before, such as ``97 % demagnetization``."""
    likely = explanation.likely if explanation else {}
    return ", ".join(
        f"{percent_text(probability, 2)} {name.replace('_', ' ')}"
        for name, probability in likely.items()
    )


def _fit_row(refit: Refit, changed: Sequence[str]) -> dict[str, Any]:
    has_validation = refit.noise_ratios.get(("validation", "current")) is not None
    role = "validation" if has_validation else "training"
    ratios = [refit.noise_ratios.get((role, channel)) for channel in ("current", "speed")]
    return {
        "effects": ", ".join(effect_words(name) for name in refit.effects) or "none",
        "ratios": [number_text(ratio, 3) for ratio in ratios],
        "role": role,
        "changed": listed(changed),
        "previous": refit.previous.fit if refit.previous else "",
    }
