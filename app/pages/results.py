"""View of the result of a fit: the parts of its report that answer the first questions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["result_view"]

_TONES = {"critical": "bad", "warning": "fair", "note": "plain"}


def result_view(result: Mapping[str, Any], report: str) -> dict[str, Any]:
    """Story, evidence, parameters, errors and step responses of a result.

    The text of the report has the figures; it is empty if it cannot be read.

    A part that the result does not have, or that its values do not allow, is empty.
    """
    # Lazy imports, here and in the other views: numpy would slow down every start.
    from identification.reporting.excerpt import report_figures
    from identification.reporting.headline import headline_sentences, key_figures
    from identification.reporting.tables import error_rows, feedback_tables, parameter_rows
    from identification.reporting.warnings import warning_groups
    from identification.result.attempts import Attempts
    from identification.result.numbers import probability_text
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
                "name": _words(effect["name"]),
                "variant": effect.get("variant") or "",
                "equation": effect["equation"],
                "drivers": ", ".join(effect["drivers"]) or "none (constant)",
                "probability": probability_text(effect["probability"]),
                "alternatives": [
                    f"{_words(other['name'])} {probability_text(other['probability'])}"
                    for other in effect.get("alternatives") or ()
                ],
            }
            for effect in result.get("effects") or ()
        ],
        # The first screen shows what an effect of a sensor removes from the residual.
        "evidence": report_figures(report, "missing") or report_figures(report, "summary"),
        "parameters": list(parameters),
        "has_before": any(row.before for row in parameters),
        "errors": rows("table of errors", error_rows, result),
        "steps": report_figures(report, "loop"),
        "feedback": [
            *rows("loop that suits", feedback_tables, result.get("feedback_suited") or ()),
            *rows("table of the loop", feedback_tables, result.get("feedback") or ()),
        ],
        "remarks": attempts.remarks,
    }


def _words(name: object) -> str:
    return str(name).replace("_", " ")
