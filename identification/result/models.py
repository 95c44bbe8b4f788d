"""Members ``effects``, ``searched`` and ``models`` of result.json.

``models`` holds the final model and its alternatives, each with a covariance.  The design of a
further run needs the joint uncertainty of the parameters, and what the alternatives predict.  A
normal approximation in search coordinates holds both: the logarithm of a positive parameter, or the
parameter over its scale.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.effects.effect import AbstractEffect, effects_of
from identification.fit.solve import Fit
from identification.result.entries import finite_or_null, parameter_entry
from identification.result.run_values import run_values
from identification.selection.outcome import Outcome, Searched

__all__ = ["effect_entries", "model_entries", "model_entry", "reason_of", "searched_entries"]


def effect_entries(
    outcome: Outcome | None,
    final: Fit,
    draws: Mapping[str, Array],
    known: Mapping[str, bool],
    fraction: float,
) -> list[dict[str, Any]]:
    """Result entries of the effects in the final model, strongest evidence first.

    `known` says whether each parameter is identified; `fraction` is the effective sample fraction
    [-].
    """
    terms = {term.name: term for term in effects_of(final.simulator.model.terms)}
    estimates = final.by_name
    entries = []
    for found in outcome.effects if outcome else ():
        term = terms[found.name]
        parameters = {}
        for parameter in term.parameters:
            full = f"{found.name}.{parameter.name}"
            parameters[parameter.name] = parameter_entry(
                draws[full], parameter.unit, known[full]
            ) | {"estimate": estimates[full], "meaning": parameter.meaning}
        entries.append(
            {
                "name": found.name,
                "variant": term.variant or None,
                **_law(term),
                "probability": found.probability,
                "comparable": found.is_comparable,
                "parameters": parameters,
                "runs": run_values(term, final, fraction),
                "evidence": {
                    "log_likelihood_gain": found.criteria.gain,
                    "log_likelihood_gain_by_chance": found.criteria.needed,
                    "error_fall_training": found.criteria.training,
                    "error_fall_validation": found.criteria.validation,
                },
                "alternatives": [
                    {"name": name, "probability": probability} for name, probability in found.others
                ],
                "settings": term.settings,
            }
        )
    return entries


def searched_entries(outcome: Outcome | None) -> list[dict[str, Any]]:
    """Result entries of all candidates, in the order of the search."""
    return [
        {
            "name": s.name,
            "variant": s.detail or None,
            "round": s.round,
            "promised_log_likelihood_gain": s.predicted_gain,
            "log_likelihood_gain": s.criteria.gain if s.criteria else None,
            "error_fall_training": s.criteria.training if s.criteria else None,
            "error_fall_validation": s.criteria.validation if s.criteria else None,
            "chosen": s.chosen,
            "reason": reason_of(s),
        }
        for s in (outcome.searched if outcome else ())
    ]


def reason_of(searched: Searched) -> str:
    """Reason why the search chose or rejected a candidate."""
    if searched.chosen:
        return "meets all acceptance criteria and reduces the error most"
    if searched.flaw:
        return searched.flaw
    if searched.criteria is None:
        return "predicted gain smaller than that of the candidates that were fitted"
    return searched.criteria.refusal or "another candidate reduces the error more"


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
            {"name": term.name, **_law(term), "settings": term.settings}
            for term in effects_of(model.terms)
        ],
        "parameters": [
            {
                "name": coordinates.names[k],
                "unit": coordinates.parameters[k].unit,
                "estimate": float(fit.values[k]),
                "search": coordinates.parameters[k].search,
                "scale": 1.0 if coordinates.parameters[k].search == "log" else float(slopes[k]),
            }
            for k in kept
        ],
        "covariance": covariance[np.ix_(kept, kept)].tolist(),
    }


def _law(term: AbstractEffect) -> dict[str, Any]:
    return {"equation": term.equation, "drivers": list(term.drivers)}
