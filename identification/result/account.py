"""Account of the effect search in plain words, and its table of candidates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from identification.effects.catalogue import CATALOGUE
from identification.effects.effect import AbstractEffect, effects_of
from identification.fit.solve import Fit
from identification.result.effect_texts import effect_words, unsupported
from identification.result.missing_terms import undrawn_sentence
from identification.result.models import reason_of
from identification.result.numbers import interval_text, listed, number_text
from identification.result.report_data import CandidateRow, MissingTerm, MissingTrace, SearchAccount
from identification.result.simulation_errors import UNEXPLAINED_CHANNEL
from identification.selection.criteria import AcceptanceCriteria
from identification.selection.outcome import Found, Outcome
from identification.surrogates.unlisted import LAWS

__all__ = ["account_of"]

_LARGEST_LOG: Final = 14.0
"""Logarithm of the largest factor that is written, about a million."""


def account_of(
    outcome: Outcome | None,
    result: Mapping[str, Any],
    final: Fit,
    terms: Sequence[MissingTerm] = (),
    traces: Sequence[MissingTrace] = (),
) -> SearchAccount | None:
    """Account of the effect search for the report; None if no search was made."""
    if outcome is None:
        return None
    by_name = {term.name: term for term in effects_of(final.simulator.model.terms)}
    diagnosis = result["diagnosis"]
    doubtful = {effect["name"] for effect in unsupported(result)}
    found = [
        _found_sentence(found, by_name[found.name], found.name in doubtful)
        for found in outcome.effects
    ]
    nothing = "No effect of the catalogue improves on the nominal model by more than chance."
    sentences = [
        diagnosis["residual"].get("sentence", ""),
        _where(diagnosis["trace"]),
        *(found or [nothing]),
        "" if doubtful else _shifts(diagnosis.get("shifts", {}), list(by_name)),
        undrawn_sentence(tuple(by_name.values())),
    ]
    remaining = [diagnosis["remaining"].get("sentence", "")]
    remaining += [
        f"{warning[0].upper()}{warning[1:]}."
        for warning, details in zip(result["warnings"], result["warning_details"], strict=True)
        if details["code"] == UNEXPLAINED_CHANNEL
    ]
    return SearchAccount(
        sentences=tuple(sentence for sentence in sentences if sentence),
        terms=tuple(terms),
        traces=tuple(traces),
        candidates=tuple(_candidates(outcome, by_name)),
        remaining=_once(remaining),
    )


def _once(sentences: Sequence[str]) -> tuple[str, ...]:
    """Sentences without those on a channel that an earlier one is about."""
    first: dict[str, str] = {}
    for sentence in filter(None, sentences):
        first.setdefault(sentence.partition(":")[0], sentence)
    return tuple(first.values())


def _where(trace: Mapping[str, Any]) -> str:
    """Sentence on the equations that lack a voltage or torque, with its standard deviation."""
    parts = []
    for equation, word in (("electrical", "voltage"), ("mechanical", "torque")):
        found = trace.get(equation)
        if found and found["significant"]:
            best = _best_driver(found["drivers"])
            driver = f", which depends mainly on the {best}" if best else ""
            parts.append(
                f"the {equation} equation lacks a {word} with a standard deviation of about "
                f"{number_text(found['strength'], 2)} {found['unit']}{driver}"
            )
    if parts:
        return f"In the nominal model, {'; '.join(parts)}."
    if "electrical" in trace:
        return (
            "Neither equation of the nominal model lacks a voltage or torque larger than sensor "
            "noise explains."
        )
    return ""


def _best_driver(drivers: Mapping[str, Mapping[str, Any]]) -> str:
    """Driver that explains most of the missing term; empty if it explains half or less."""
    shares = {name: entry["share"] or 0.0 for name, entry in drivers.items()}
    best = max(shares, key=lambda name: shares[name], default="")
    return best if best and shares[best] > 0.5 else ""


def _found_sentence(found: Found, term: AbstractEffect, is_doubtful: bool) -> str:
    if found.name == "unlisted":
        drivers = " and ".join(term.drivers) or "no driver"
        missing = {"electrical": "voltage", "mechanical": "torque"}.get(term.equation, "part")
        is_law = isinstance(term, LAWS)
        form = f"the law “{term.variant}”" if is_law else f"a curve over {drivers}"
        text = (
            f"No effect of the catalogue explains the missing {missing} of the {term.equation} "
            f"equation; {form} represents it."
        )
    else:
        variant = f" ({term.variant})" if term.variant else ""
        words = effect_words(found.name).capitalize()
        verb = "stands in for something that the catalogue lacks" if is_doubtful else "acts"
        text = f"{words}{variant} {verb} in the {term.equation} equation."
    training, unseen = found.criteria.training, found.criteria.validation
    text += (
        " With it, the simulation error, averaged over current and speed, "
        f"{_change(training)} on the training runs"
    )
    text += "." if unseen is None else f" and {_change(unseen, training)} on the validation runs."
    if found.others:
        others = ", ".join(
            effect_words(name) + (f" ({100 * share:.0f} %)" if found.is_comparable else "")
            for name, share in found.others
        )
        text += f" Alternatives that the runs do not exclude: {others}."
    return text


def _change(fall: float, previous: float | None = None) -> str:
    """Change of an error in words; the verb is omitted after a previous change of the same sign."""
    if previous is not None and (fall >= 0) == (previous >= 0):
        return f"by {_percent(fall)}"
    return f"{'falls' if fall >= 0 else 'rises'} by {_percent(fall)}"


def _percent(fall: float) -> str:
    """Change of the RMS error in per cent, geometric mean over current and speed.

    `fall` is that of its logarithm, summed over the two channels.
    """
    return f"{100 * abs(1 - _power(-0.5 * fall)):.1f} %"


def _power(exponent: float) -> float:
    """Exponential function; the exponent is bounded because larger factors need no exact value."""
    return math.exp(min(exponent, _LARGEST_LOG))


def _shifts(shifts: Mapping[str, Any], effects: Sequence[str]) -> str:
    """Sentence on the bias of the nominal-model parameters that the missing effects caused."""
    moved = {
        name: shift["relative"]
        for name, shift in shifts.items()
        if shift["off"] and None not in shift["relative"].values()
    }
    if not moved:
        return ""
    effects = [effect_words(name) for name in effects]
    worst_first = sorted(moved, key=lambda name: -abs(moved[name]["median"]))
    biases = [f"{name} is {_off(moved[name])}" for name in worst_first]
    return (
        f"The nominal model omits {listed(effects)}, and its estimates are therefore biased: "
        f"{listed(biases)} (in brackets: 90 % intervals)."
    )


def _off(relative: Mapping[str, Any]) -> str:
    """Bias as text, such as ``13.0 % too high (12.9 to 13.1 %)``."""
    low, middle, high = sorted(100 * abs(relative[key]) for key in ("q05", "median", "q95"))
    text = interval_text(middle, low, high)
    side = "high" if relative["median"] > 0 else "low"
    return f"{text.median} % too {side} ({text.low} to {text.high} %)"


def _candidates(outcome: Outcome, terms: Mapping[str, AbstractEffect]) -> list[CandidateRow]:
    """Effects of the final model, then the first trial of each other effect type, best first."""
    alternatives = {
        name: share if found.is_comparable else None
        for found in outcome.effects
        for name, share in found.others
    }
    rows: dict[str, CandidateRow] = {}
    for found in outcome.effects:
        refusal = found.criteria.refusal
        reason = "meets all acceptance criteria"
        if refusal:
            reason = f"in the final model, but together with the other effects {refusal}"
        rows[found.name] = CandidateRow(
            found.name, _equation(found.name, terms), *_changes(found.criteria),
            found.probability if found.is_comparable else None, "chosen", reason,
        )  # fmt: skip
    for s in outcome.searched:
        if s.name not in rows:
            rows[s.name] = CandidateRow(
                s.name, _equation(s.name, terms), *_changes(s.criteria), alternatives.get(s.name),
                "alternative" if s.name in alternatives else "ruled out",
                "selected first, then replaced by another effect" if s.chosen else reason_of(s),
            )  # fmt: skip
    order = {"chosen": 0, "alternative": 1, "ruled out": 2}
    return sorted(rows.values(), key=lambda row: (order[row.verdict], -(row.explained or 0.0)))


def _equation(name: str, terms: Mapping[str, AbstractEffect]) -> str:
    """Equation that an effect enters, from the final model or else from the catalogue."""
    kind = terms.get(name) or CATALOGUE.get(name)
    return kind.equation if kind else "any"


def _changes(criteria: AcceptanceCriteria | None) -> tuple[float | None, float | None]:
    """Explained fraction of the squared training error, change of the validation error [-].

    Both are geometric means over current and speed, over which the falls are summed.
    """
    if criteria is None:
        return None, None
    explained = max(0.0, 1 - _power(-criteria.training))
    unseen = criteria.validation
    return explained, None if unseen is None else _power(-unseen) - 1
