"""Member ``models`` of result.json: the final model and its alternatives, each with a covariance.

The design of a further run needs the joint uncertainty of the parameters, and what the alternatives
predict.  A normal approximation in search coordinates holds both: the logarithm of a positive
parameter, or the parameter over its scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.effects.effect import effects_of
from identification.fit.solve import Fit
from identification.result.entries import finite_or_null
from identification.selection.outcome import Outcome

__all__ = ["model_entries", "model_entry"]


def model_entries(outcome: Outcome | None, final: Fit, fraction: float) -> list[dict[str, Any]]:
    """Entries of the final model, then of each alternative of each effect.

    `fraction` is the effective sample fraction [-].
    """
    entries = [model_entry(final, fraction)]
    for found in outcome.effects if outcome else ():
        for other in found.alternatives:
            entry = model_entry(other.fit, other.fraction)
            odds = other.probability / max(found.probability, 1e-300)
            entries.append(entry | {"name": other.name, "replaces": found.name, "odds": odds})
    return [finite_or_null(entry) for entry in entries]


def model_entry(fit: Fit, fraction: float) -> dict[str, Any]:
    """Entry of one fitted model; temperatures of earlier runs are marginalised."""
    model, coordinates = fit.simulator.model, fit.coordinates
    passed = {parameter.name for parameter in model.unlogged.parameters}
    kept = [k for k, name in enumerate(coordinates.names) if name not in passed]
    covariance = fit.equations.covariance(fraction)
    slopes = coordinates.slopes(fit.position)
    return {
        "name": None,
        "replaces": None,
        "odds": 1.0,
        "hold": model.hold,
        "effective_fraction": fraction,
        "terms": [
            {
                "name": term.name,
                "equation": term.equation,
                "drivers": list(term.drivers),
                "settings": term.settings,
            }
            for term in effects_of(model.terms)
        ],
        "parameters": [
            {
                "name": coordinates.names[k],
                "unit": coordinates.parameters[k].unit,
                "estimate": float(fit.values[k]),
                "search": coordinates.parameters[k].search,
                "scale": _scale(slopes[k], coordinates.parameters[k].search),
            }
            for k in kept
        ],
        "covariance": _rows(covariance[np.ix_(kept, kept)]),
    }


def _scale(slope: float, search: str) -> float:
    return 1.0 if search == "log" else float(slope)


def _rows(matrix: Array) -> Sequence[Sequence[float]]:
    rows: list[list[float]] = matrix.tolist()
    return rows
