"""Result entries of the effects and of the candidates of the search."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from identification.arrays import Array
from identification.effects.effect import effects_of
from identification.fit.solve import Fit
from identification.result.entries import parameter_entry
from identification.selection.outcome import Found, Outcome, Searched

__all__ = ["effect_entries", "reason_of", "searched_entries"]


def effect_entries(
    outcome: Outcome | None, final: Fit, draws: Mapping[str, Array], known: Mapping[str, bool]
) -> list[dict[str, Any]]:
    """Result entries of the effects in the final model, strongest evidence first.

    `known` says whether each parameter is identified.
    """
    terms = {term.name: term for term in effects_of(final.simulator.model.terms)}
    estimates = dict(zip(final.coordinates.names, final.values, strict=True))
    entries = []
    for found in outcome.effects if outcome else ():
        term = terms[found.name]
        parameters = {}
        for parameter in term.parameters:
            full = f"{found.name}.{parameter.name}"
            parameters[parameter.name] = parameter_entry(
                draws[full], parameter.unit, known[full]
            ) | {"estimate": float(estimates[full]), "meaning": parameter.meaning}
        entries.append(
            {
                "name": found.name,
                "variant": term.variant or None,
                "equation": term.equation,
                "drivers": list(term.drivers),
                "probability": found.probability,
                "parameters": parameters,
                "evidence": _evidence(found),
                "alternatives": [
                    {"name": name, "probability": probability} for name, probability in found.others
                ],
                "settings": term.settings,
            }
        )
    return entries


def _evidence(found: Found) -> dict[str, Any]:
    criteria = found.criteria
    return {
        "log_likelihood_gain": criteria.gain,
        "log_likelihood_gain_by_chance": criteria.needed,
        "error_fall_training": criteria.training,
        "error_fall_validation": criteria.validation,
    }


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
