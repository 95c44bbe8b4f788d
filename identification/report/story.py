"""How an effect was found, as entries of the result and as the story of the report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.effects.catalogue import CATALOGUE
from identification.effects.search import Found, Outcome, Searched
from identification.fit.solve import Fit
from identification.report.data import Candidate, Story
from identification.report.result import parameter_entry

__all__ = ["effect_entries", "searched_entries", "story_of"]

Array = NDArray[np.float64]


def effect_entries(
    outcome: Outcome | None, final: Fit, draws: Mapping[str, Array], known: Mapping[str, bool]
) -> list[dict[str, Any]]:
    """The effects of the final model, strongest evidence first.

    Args:
        outcome: What the search found; None where none was made.
        final: Fit of the final model.
        draws: Draws of its posterior by name.
        known: Which parameters are identified.
    """
    terms = {term.name: term for term in final.simulator.model.terms}
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
                "equation": term.equation,
                "drivers": list(term.drivers),
                "probability": found.probability,
                "parameters": parameters,
                "evidence": _evidence(found),
                "alternatives": [
                    {"name": other.name, "probability": other.probability}
                    for other in found.alternatives
                ],
                "settings": dict(vars(term)),
            }
        )
    return entries


def _evidence(found: Found) -> dict[str, Any]:
    gates = found.gates
    return {
        "log_likelihood_gain": gates.gain,
        "log_likelihood_gain_by_chance": gates.needed,
        "error_fall_training": gates.training,
        "error_fall_validation": gates.validation,
    }


def searched_entries(outcome: Outcome | None) -> list[dict[str, Any]]:
    """Everything that was looked at, in the order of the search."""
    return [
        {
            "name": s.name,
            "variant": s.detail or None,
            "round": s.round,
            "promised_log_likelihood_gain": s.promised,
            "log_likelihood_gain": s.gates.gain if s.gates else None,
            "error_fall_training": s.gates.training if s.gates else None,
            "error_fall_validation": s.gates.validation if s.gates else None,
            "chosen": s.chosen,
            "reason": _reason(s),
        }
        for s in (outcome.searched if outcome else ())
    ]


def _reason(searched: Searched) -> str:
    if searched.chosen:
        return "passes chance, size and prediction, and explains most"
    if searched.gates is None:
        return "screening promised less than the candidates that were fitted"
    return searched.gates.refusal or "another candidate explains more"


def story_of(outcome: Outcome | None, result: Mapping[str, Any]) -> Story | None:
    """The story for the report; None where no search was made.

    Args:
        outcome: What the search found.
        result: Content of result.json.
    """
    if outcome is None:
        return None
    names = [found.name for found in outcome.effects]
    sentences = [_found_sentence(found) for found in outcome.effects]
    if not names:
        sentences = [
            "No effect of the catalogue explains anything beyond the declared model that could "
            "not be chance."
        ]
    else:
        sentences += _shifts(result)
    return Story(
        sentences=tuple(sentences),
        candidates=tuple(_candidates(outcome, names)),
        remaining=tuple(w for w in result["warnings"] if "lacks something" in w),
    )


def _found_sentence(found: Found) -> str:
    kind = CATALOGUE[found.name]
    words = found.name.replace("_", " ")
    validation = (
        ""
        if found.gates.validation is None
        else f", and by {_percent(found.gates.validation)} on the runs left out"
    )
    text = (
        f"{words.capitalize()} is in the {kind.equation} equation: with it the simulation error "
        f"falls by {_percent(found.gates.training)} on the training runs{validation}."
    )
    if found.alternatives:
        others = ", ".join(
            f"{o.name.replace('_', ' ')} ({100 * o.probability:.0f} %)" for o in found.alternatives
        )
        text += f" The runs do not rule out in its place: {others}."
    return text


def _percent(fall: float) -> str:
    """The fall of a root mean square from the fall of its logarithm, in per cent."""
    return f"{100 * (1 - math.exp(-fall)):.1f} %"


def _shifts(result: Mapping[str, Any]) -> list[str]:
    """How far the declared parameters had been off because the effects were in them."""
    moved = []
    for name, after in result["parameters"].items():
        before = result["declared"]["parameters"].get(name)
        if before is None or not after["identified"] or not after["mean"]:
            continue
        shift = (before["mean"] - after["mean"]) / abs(after["mean"])
        spread = math.hypot(before["sd"] or 0.0, after["sd"] or 0.0)
        if abs(before["mean"] - after["mean"]) > 3 * spread:
            moved.append(
                (
                    abs(shift),
                    f"{name} was {100 * abs(shift):.1f} % too "
                    f"{'high' if before['mean'] > after['mean'] else 'low'}",
                )
            )
    if not moved:
        return []
    moved.sort(reverse=True)
    return ["Without it: " + ", ".join(text for _, text in moved) + "."]


def _candidates(outcome: Outcome, names: list[str]) -> list[Candidate]:
    """The first look at each kind, best first."""
    alternatives = {o.name: o.probability for found in outcome.effects for o in found.alternatives}
    chances = {found.name: found.probability for found in outcome.effects}
    rows: dict[str, Candidate] = {}
    for s in outcome.searched:
        chosen = s.name in names and s.chosen
        if s.name in rows and not chosen:
            continue
        verdict = "chosen" if chosen else "alternative" if s.name in alternatives else "ruled out"
        gates = s.gates
        rows[s.name] = Candidate(
            name=s.name,
            equation=CATALOGUE[s.name].equation,
            explained=None if gates is None else max(0.0, 1 - math.exp(-2 * gates.training)),
            held_out=None
            if gates is None or gates.validation is None
            else math.exp(-2 * gates.validation) - 1,
            probability=chances.get(s.name) if chosen else alternatives.get(s.name),
            verdict=verdict,  # type: ignore[arg-type]
            reason=_reason(s),
        )
    order = {"chosen": 0, "alternative": 1, "ruled out": 2}
    return sorted(rows.values(), key=lambda row: (order[row.verdict], -(row.explained or 0.0)))
