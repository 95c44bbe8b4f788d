"""Views of results: one fit, with the parts of its report, and two fits side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from identification.result.attempts import Attempts, figure
from identification.result.effect_texts import (
    alternative_texts,
    effect_probability,
    effect_words,
)
from identification.result.numbers import (
    UNKNOWN,
    entry_text,
    number_text,
    signed_percent_text,
    unit_prefix,
    unit_text,
)

if TYPE_CHECKING:
    from identification.fleet.drift import Drift
    from identification.speed_loop import StepCurve

__all__ = ["comparison_view", "result_view"]

_TONES = {"critical": "bad", "warning": "fair", "note": "plain"}

Result = Mapping[str, Any]


def result_view(result: Mapping[str, Any], report: str) -> dict[str, Any]:
    """Story, evidence, parameters, errors and step responses of a result.

    The text of the report has the figures; it is empty if it cannot be read.

    A part that the result does not have, or that its values do not allow, is empty.
    """
    # Lazy imports, here and in the other views: scipy would slow down every start.
    from identification.reporting.figures.drawn import report_figures
    from identification.reporting.headline import headline_sentences, key_figures
    from identification.reporting.tables import error_rows, feedback_tables, parameter_rows
    from identification.reporting.warnings import warning_groups
    from identification.result.report_data import ReportData

    attempts = Attempts()
    rows = attempts.rows
    groups = rows("warnings", warning_groups, result)
    parameters = rows("table of parameters", parameter_rows, ReportData(result, ()))
    return {
        "story": rows("summary", headline_sentences, result),
        "key_figures": rows("key figures", key_figures, result),
        "warnings": dict.fromkeys(_TONES.values(), ())
        | {_TONES[group.severity]: group.items for group in groups},
        "effects": [
            {
                "name": effect_words(effect["name"]),
                "variant": effect.get("variant") or "",
                "equation": effect["equation"],
                "drivers": ", ".join(effect["drivers"]) or "none (constant)",
                "probability": effect_probability(effect),
                "alternatives": alternative_texts(effect),
            }
            for effect in result.get("effects") or ()
        ],
        # The first screen shows what an effect of a sensor removes from the residual.
        "evidence": report_figures(report, "missing") or report_figures(report, "summary"),
        "parameters": list(parameters),
        "has_before": any(row.before for row in parameters),
        "errors": rows("table of errors", error_rows, result),
        "steps": report_figures(report, "loop"),
        "proposed": [entry["controller"] for entry in (result.get("feedback_suited") or ())[:1]],
        "feedback": [
            *rows("loop that suits", feedback_tables, result.get("feedback_suited") or ()),
            *rows("table of the loop", feedback_tables, result.get("feedback") or ()),
        ],
        "remarks": attempts.remarks,
    }


def comparison_view(
    results: Sequence[Result], steps: Sequence[Sequence[StepCurve]]
) -> dict[str, Any]:
    """Parameters, effects, errors and step responses of two fits.

    The step responses have the same controller and temperatures.
    """
    from identification.fleet.refit import searches_effects
    from identification.reporting.figures.curves import compared_steps_figure
    from identification.reporting.figures.drawn import drawn_chart

    first, second = results
    attempts = Attempts()
    return {
        "parameters": attempts.rows("table of parameters", _parameters, first, second),
        "effects": attempts.rows("table of effects", _effects, first, second),
        "errors": attempts.rows("table of errors", _errors, first, second),
        "is_tested": searches_effects(first) == searches_effects(second),
        "shared": len(_training(first) & _training(second)),
        "steps": [
            {
                "figure": figure("step response", drawn_chart, compared_steps_figure(*pair)),
                "temperature": f"{pair[0].temperature_degC:g} °C",
                "controller": pair[0].controller,
            }
            for pair in zip(*steps, strict=True)
        ],
        "remarks": attempts.remarks,
    }


def _parameters(first: Result, second: Result) -> list[dict[str, Any]]:
    """Parameters of the motor with tested differences, then those of the effects."""
    from identification.fleet.drift import drift_of, drifts
    from identification.fleet.refit import compared_with, estimate_of, refit_of

    [tested] = drifts([compared_with(refit_of("", "", second), refit_of("", "", first))])
    older, newer = _entries(first), _entries(second)
    rows = []
    for name in dict.fromkeys([*older, *newer]):
        a, b = older.get(name), newer.get(name)
        drift = tested.get(name)
        if drift is None and a is not None and b is not None:
            drift = drift_of(estimate_of(b), estimate_of(a))
        rows.append(_row(name, a, b, drift))
    return rows


def _row(name: str, a: Result | None, b: Result | None, drift: Drift | None) -> dict[str, Any]:
    # A change relative to a value that may be zero says nothing.
    is_relative = drift is not None and all(
        one is None or None in (one["q05"], one["q95"]) or one["q05"] * one["q95"] > 0.0
        for one in (a, b)
    )
    unit = (b or a or {}).get("unit", "")
    factor, unit = unit_prefix(unit, [one["median"] for one in (a, b) if one is not None])
    return {
        "name": name,
        "unit": unit_text(unit),
        "estimates": [None if one is None else entry_text(one, factor) for one in (a, b)],
        "is_identified": [one is None or bool(one["identified"]) for one in (a, b)],
        "relative": signed_percent_text(drift.relative) if drift and is_relative else UNKNOWN,
        "sds": UNKNOWN
        if drift is None or drift.sds is None
        else f"{drift.sds:+z.1f}".replace("-", "−"),
        "is_significant": drift is not None and drift.is_significant is True,
    }


def _entries(result: Result) -> dict[str, Result]:
    """Parameters of the motor by name, and those of the effects by ``effect.parameter``."""
    own = {
        f"{effect['name']}.{name}": entry
        for effect in result["effects"]
        for name, entry in effect["parameters"].items()
    }
    return {**result["parameters"], **own}


def _effects(first: Result, second: Result) -> list[dict[str, Any]]:
    """Probability of each effect in both fits; a dash where a fit does not have it."""
    found = [{e["name"]: effect_probability(e) for e in one["effects"]} for one in (first, second)]
    return [
        {"name": effect_words(name), "probabilities": [one.get(name, UNKNOWN) for one in found]}
        for name in dict.fromkeys([*found[0], *found[1]])
    ]


def _errors(first: Result, second: Result) -> list[dict[str, Any]]:
    """Simulation error over sensor noise of both final models, by role and channel."""
    rows = []
    for role in ("validation", "training"):
        for channel in ("current", "speed"):
            entries = [
                ((one["errors"]["after"].get(role) or {}).get(channel) or {})
                for one in (first, second)
            ]
            ratios = [entry.get("noise_ratio") for entry in entries]
            if any(ratio is not None for ratio in ratios):
                texts = [number_text(ratio, 3) for ratio in ratios]
                rows.append({"role": role, "channel": channel, "ratios": texts})
    return rows


def _training(result: Result) -> set[str]:
    runs = result.get("runs") or ()
    return {run["sha256"] for run in runs if run.get("role") == "training"}
