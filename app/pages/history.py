"""View of the fits of one motor over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identification.fleet.explanation import Explanation
    from identification.fleet.refit import Refit

__all__ = ["history_view"]


def history_view(refits: Sequence[Refit], requested_at: Mapping[str, str]) -> dict[str, Any]:
    """Plots of the parameters over the fits of one motor, and a row for each fit.

    The refits are the newest first; the times of the requests are UTC, ISO 8601, by ID.
    """
    from identification.fleet.drift import drifts
    from identification.fleet.explanation import explanations
    from identification.fleet.history import history_figure
    from identification.fleet.refit import compared_with
    from identification.quantities import DECLARED_PARAMETERS
    from identification.result.attempts import figure
    from identification.result.numbers import with_symbols

    oldest_first = [refit for refit in reversed(refits) if refit.estimates]
    compared = [
        compared_with(refit, before)
        for refit, before in zip(oldest_first, [None, *oldest_first], strict=False)
    ]
    changes = drifts(compared)
    causes = explanations(compared)
    labels = _dates([datetime.fromisoformat(requested_at[refit.fit]) for refit in compared])
    drawn = [
        figure(f"history of {name}", history_figure, name, compared, changes, labels)
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
                **_row(refit, [n for n, drift in moved.items() if drift.is_significant]),
                "causes": _causes(explanation),
            }
            for refit, moved, explanation in zip(compared, changes, causes, strict=True)
        },
    }


def _causes(explanation: Explanation | None) -> str:
    """Probable causes of the change since the fit before, such as ``97 % demagnetization``."""
    from identification.result.numbers import percent_text

    likely = explanation.likely if explanation else {}
    return ", ".join(
        f"{percent_text(probability, 2)} {name.replace('_', ' ')}"
        for name, probability in likely.items()
    )


def _dates(moments: Sequence[datetime]) -> list[str]:
    """Dates of the fits; times of the day if all are of one day."""
    has_one_day = len({moment.date() for moment in moments}) == 1
    return [f"{moment:%H:%M} UTC" if has_one_day else f"{moment:%Y-%m-%d}" for moment in moments]


def _row(refit: Refit, changed: Sequence[str]) -> dict[str, Any]:
    from identification.result.numbers import UNKNOWN, listed, number_text

    has_validation = refit.noise_ratios.get(("validation", "current")) is not None
    role = "validation" if has_validation else "training"
    ratios = [refit.noise_ratios.get((role, channel)) for channel in ("current", "speed")]
    return {
        "effects": ", ".join(name.replace("_", " ") for name in refit.effects) or "none",
        "ratios": [UNKNOWN if ratio is None else number_text(ratio, 3) for ratio in ratios],
        "role": role,
        "changed": listed(changed),
        "previous": refit.previous.fit if refit.previous else "",
    }
