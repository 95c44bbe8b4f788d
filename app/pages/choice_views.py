"""View models of the choice of runs and of the precision that they permit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from app.pages.views import located, run_view
from app.runs.schemas import RunOut
from app.tables import RunRow

__all__ = ["choice_view", "prospects_view"]

_INTERVAL = 1.645
"""Half width of a 90 % interval of a normal distribution [standard deviations]."""


def choice_view(
    runs: Sequence[RunRow],
    roles: Mapping[str, str],
    *,
    is_proposal: bool,
    has_more: bool,
    motor: str,
    motors: Sequence[str],
) -> dict[str, Any]:
    """View of the runs of a motor with their roles."""
    chosen = [run for run in runs if roles[run.id]]
    return {
        "runs": [run_view(RunOut.of(run)) | {"role": roles[run.id]} for run in runs],
        "training": sum(role == "training" for role in roles.values()),
        "validation": sum(role == "validation" for role in roles.values()),
        "is_proposal": is_proposal and bool(runs),
        "has_more": has_more,
        "motor": motor,
        "motors": motors,
        "is_mixed": len({run.motor for run in chosen}) > 1,
    }


def prospects_view(found: Mapping[str, Any] | None, training: int) -> dict[str, Any]:
    """View of the preview of the training runs; None if no run is chosen."""
    if found is None:
        return {"training": 0}
    # Lazy import: numpy would slow down every start.
    from identification.result.numbers import number_text, unit_prefix, unit_text

    units = {n: unit_prefix(e["unit"], [e["value"]]) for n, e in found["parameters"].items()}
    parameters = [
        {
            "name": name,
            "value": number_text(units[name][0] * entry["value"], 3),
            "unit": unit_text(units[name][1]),
            "precision": _precision(entry),
            "identified": entry["identified"],
            "advice": entry["advice"],
        }
        for name, entry in found["parameters"].items()
    ]
    lacking = [p["name"] for p in parameters if not p["identified"]]
    return {
        "training": training,
        "parameters": parameters,
        "lacking": lacking,
        "errors": [
            {"text": ": ".join(filter(None, (e["file"], located(e)))), "code": e["code"]}
            for e in found["errors"]
        ],
        "findings": [
            {
                "is_refused": f["severity"] == "refuse",
                "code": f["code"],
                "text": ": ".join(word for word in (f["file"], f["column"], f["message"]) if word),
            }
            for f in found["findings"]
        ],
        "notes": found["notes"],
    }


def _precision(entry: Mapping[str, Any]) -> str:
    """Half width of the expected 90 % interval in percent of the value."""
    if entry["expected_sd"] is None or not entry["value"]:
        return "unknown"
    percent = 100.0 * _INTERVAL * entry["expected_sd"] / abs(entry["value"])
    return f"± {percent:.2g} %" if percent < 99.5 else "above 100 %"
