"""Effects of result.json in words: their probabilities, and which of them are surrogates.

A probability compares models of which one is true.  If none of them explains the runs, it says
nothing about the motor, however large it is.
"""

from __future__ import annotations

from collections.abc import Callable

from identification.result.entries import NOTHING, Entry
from identification.result.numbers import listed, percent_text, probability_text

__all__ = [
    "alternative_texts",
    "certain_effects",
    "doubt_sentence",
    "effect_details",
    "effect_probability",
    "effect_words",
    "has_no_probability",
    "is_surrogate",
    "unexplained_words",
    "unsupported",
]

_OUTSIDE = "unlisted"
_PEOPLE = {"coulomb": "Coulomb", "stribeck": "Stribeck"}


def effect_words(name: str) -> str:
    """Name of an effect in a sentence."""
    return " ".join(_PEOPLE.get(word, word) for word in name.split("_"))


def has_no_probability(effect: Entry) -> bool:
    """True if none of the compared models explains the runs."""
    return effect.get("comparable") is False


def effect_probability(effect: Entry) -> str:
    """Probability of an effect as text."""
    return (
        "not applicable" if has_no_probability(effect) else probability_text(effect["probability"])
    )


def effect_details(effect: Entry) -> str:
    """Probability of an effect, and the law of an unlisted one."""
    law = str(effect.get("variant") or "").partition(",")[0]
    law = f"{law}, " if law and effect["name"] == _OUTSIDE else ""
    return f"{law}probability {effect_probability(effect)}"


def alternative_texts(effect: Entry) -> list[str]:
    """Alternatives of an effect, with their probabilities if they apply."""
    names = {one["name"]: effect_words(one["name"]) for one in effect.get("alternatives") or ()}
    if has_no_probability(effect):
        return list(names.values())
    return [
        f"{names[one['name']]} {probability_text(one['probability'])}"
        for one in effect.get("alternatives") or ()
    ]


def unexplained_words(result: Entry) -> str:
    """Explained variance of the channels of which the model explains nothing."""
    errors: Entry = result["errors"]["after"].get("training") or {}
    shares = {
        channel: max(0.0, 1.0 - error["nrmse"] ** 2)
        for channel, error in errors.items()
        if error and (error["nrmse"] or 0.0) > NOTHING
    }
    parts = [
        f"{percent_text(share, 2)} of the variance of the {name}" for name, share in shares.items()
    ]
    return f"the model explains {listed(parts)}" if parts else ""


def is_surrogate(effect: Entry) -> bool:
    """True if a term outside the catalogue is more probable than the effect."""
    others = effect.get("alternatives") or ()
    probabilities = {one["name"]: one["probability"] for one in others}
    return (probabilities.get(_OUTSIDE) or 0.0) > (effect["probability"] or 0.0)


def unsupported(result: Entry) -> list[Entry]:
    """Effects of the final model that are no statement about the motor.

    These are the surrogates, and all effects if none of the compared models explains the runs.
    """
    effects: list[Entry] = list(result["effects"])
    if any(has_no_probability(effect) for effect in effects):
        return effects
    return [effect for effect in effects if is_surrogate(effect)]


def certain_effects(result: Entry) -> list[Entry]:
    """Effects of the final model without those of `unsupported`."""
    doubtful = unsupported(result)
    return [effect for effect in result["effects"] if effect not in doubtful]


def doubt_sentence(result: Entry, described: Callable[[Entry], str]) -> str:
    """Sentence on the effects of `unsupported`; empty if there are none.

    `described` gives a surrogate with its details.
    """
    doubtful = unsupported(result)
    if not doubtful:
        return ""
    if any(has_no_probability(effect) for effect in doubtful):
        names = listed([effect_words(effect["name"]) for effect in doubtful])
        return f"No effect is certain: the fit added {names}, but {unexplained_words(result)}."
    parts = listed([described(effect) for effect in doubtful])
    return f"The fit uses {parts} in place of something that the catalogue lacks."
