"""Summary of the result in plain words."""

from __future__ import annotations

from collections.abc import Sequence

from identification.reporting.loops import loop_sentence
from identification.result.effect_texts import (
    alternative_texts,
    certain_effects,
    doubt_sentence,
    effect_details,
    effect_words,
    unsupported,
)
from identification.result.entries import NEAR_NOISE, Entry, known_only_from
from identification.result.numbers import count_text, listed, number_text, percent_text

__all__ = [
    "DOWN_TO_NOISE",
    "POOR_FIT",
    "deciding_errors",
    "further_sentences",
    "identified_sentence",
    "is_incomplete",
    "summary_sentences",
    "verdict_words",
]

DOWN_TO_NOISE = 1.02
_NAMED = 2
POOR_FIT = 0.5
"""NRMSE above which a fit is poor regardless of its noise ratio [-]."""


def summary_sentences(result: Entry) -> list[str]:
    """Summary of the data, the effects, the fit quality, the parameters and the closed loop."""
    forced = (
        "The runs contradict the motor equations or each other, and the fit was forced: do not "
        "rely on any number below (see Warnings)."
    )
    sentences = [
        forced if result.get("forced") else "",
        _campaign(result["runs"]),
        _effects(result),
        _shifted(result),
        _quality(result),
        identified_sentence(result),
        _given(result),
        loop_sentence(result),
    ]
    return [sentence for sentence in sentences if sentence]


def further_sentences(result: Entry) -> list[str]:
    """Sentences of the summary on the data, the biases, the given knowledge and the loop."""
    sentences = (_shifted(result), _given(result), loop_sentence(result))
    return [_campaign(result["runs"]), *filter(None, sentences)]


def _campaign(runs: Sequence[Entry]) -> str:
    fitted = [run for run in runs if run["role"] == "training"]
    checked = [run for run in runs if run["role"] == "validation"]
    sentence = f"The model was fitted to {_runs_and_rows(fitted)}"
    if not checked:
        return f"{sentence}; there are no validation runs."
    seen = sum(_was_fitted(run, runs) for run in checked)
    if seen == len(checked):
        which = "validation run is" if seen == 1 else "validation runs are"
        return (
            f"{sentence}; the {which} identical to training runs, so there is no independent "
            "validation."
        )
    validated = f"{sentence} and validated on {_runs_and_rows(checked)}"
    if seen:
        verb = "is" if seen == 1 else "are"
        return f"{validated}; {seen} of these runs {verb} identical to training runs."
    return f"{validated} not used in the fit."


def _was_fitted(run: Entry, runs: Sequence[Entry]) -> bool:
    """True if a run holds the same samples as a training run."""
    place = run.get("same_as")
    return place is not None and runs[place]["role"] == "training"


def _runs_and_rows(runs: Sequence[Entry]) -> str:
    rows = sum(int(run["rows"]) for run in runs)
    noun = "run" if len(runs) == 1 else "runs"
    return f"{len(runs)} {noun} with {count_text(rows)} samples"


def _effects(result: Entry) -> str:
    parts = [_described(effect) for effect in certain_effects(result)]
    sentence = f"The final model extends the nominal model by {listed(parts)}." if parts else ""
    return " ".join(filter(None, (sentence, doubt_sentence(result, _described))))


def _described(effect: Entry) -> str:
    """Name of an effect with its equation, drivers, probability and alternatives."""
    name = effect_words(effect["name"])
    label = "driver" if len(effect["drivers"]) == 1 else "drivers"
    details = [f"{label}: {listed(effect['drivers'])}"] if effect["drivers"] else []
    details += [effect_details(effect)]
    details += [f"alternative: {text}" for text in alternative_texts(effect)]
    return f"{name} in the {effect['equation']} equation ({', '.join(details)})"


def _shifted(result: Entry) -> str:
    """Sentence on the parameters that the missing effects biased most, if all are certain."""
    if unsupported(result):
        return ""
    shifts = (result["diagnosis"].get("shifts") or {}).items()
    medians = {
        name: shift["relative"]["median"]
        for name, shift in shifts
        if shift["off"] and shift["relative"]["median"] is not None
    }
    worst = sorted(medians.items(), key=lambda item: -abs(item[1]))[:_NAMED]
    if not worst:
        return ""
    biases = [
        f"{name} {percent_text(abs(bias), 3 if abs(bias) >= 1.0 else 2)} "
        f"too {'high' if bias > 0 else 'low'}"
        for name, bias in worst
    ]
    cause = "this effect" if len(result["effects"]) == 1 else "these effects"
    return f"Without {cause}, the fit estimates {listed(biases)}."


def _quality(result: Entry) -> str:
    role, errors = deciding_errors(result)
    ratios = {
        channel: errors[channel]["noise_ratio"]
        for channel in ("current", "speed")
        if errors.get(channel) and errors[channel]["noise_ratio"] is not None
    }
    if not ratios:
        return ""
    before = (result["errors"]["before"].get(role) or {}) if result["effects"] else {}
    texts = [
        f"{number_text(ratio, 3)} for the {name}{_formerly(before.get(name))}"
        for name, ratio in ratios.items()
    ]
    verdict = verdict_words(result)
    return f"On the {role} runs, the ratio of RMSE to sensor noise is {listed(texts)}: {verdict}."


def verdict_words(result: Entry, coloured: Sequence[str] = ()) -> str:
    """Interpretation of the noise ratios on the deciding runs; empty if there are none.

    `coloured` names the channels whose residual is not white on these runs.
    """
    _, errors = deciding_errors(result)
    known = {name: error for name, error in errors.items() if error}
    ratios = [error["noise_ratio"] for error in known.values() if error["noise_ratio"] is not None]
    missed = [
        f"the {channel} (NRMSE {percent_text(error['nrmse'], 3)})"
        for channel, error in known.items()
        if (error["nrmse"] or 0.0) > POOR_FIT
    ]
    if missed:
        return (
            f"but the model explains little of {listed(missed)}; either it does not apply to these "
            "runs, or the sensor signal is mostly noise"
        )
    return _verdict(result, max(ratios), coloured) if ratios else ""


def _verdict(result: Entry, worst: float, coloured: Sequence[str]) -> str:
    """Interpretation of the noise ratio together with the other residual tests."""
    remaining = result["diagnosis"].get("remaining") or {}
    failed = {check["role"] for check in remaining.get("checks", []) if not check["passed"]}
    if failed == {"validation"}:
        return (
            "the residual is not noise, as it is on the training runs; the validation runs may "
            "contain an effect or a condition that no training run contains"
        )
    if worst > NEAR_NOISE and (failed or not remaining):
        return "the model lacks an effect of the motor or of a sensor"
    if worst <= NEAR_NOISE and coloured:
        # If the noise is estimated from the same residuals, a ratio of 1 proves nothing.
        return (
            f"but the residual of {listed([f'the {name}' for name in coloured])} is not white; "
            "either the sensor has a lag or the model lacks an effect (see Residuals)"
        )
    if failed:
        return "but the model does not explain the training runs down to their noise"
    if worst <= (NEAR_NOISE if remaining else DOWN_TO_NOISE):
        return "the residual does not exceed the sensor noise"
    if worst <= NEAR_NOISE:
        return "a small part of the residual exceeds the sensor noise"
    return "the excess is within the scatter of so few samples"


def _formerly(error: Entry | None) -> str:
    ratio = error["noise_ratio"] if error else None
    return "" if ratio is None else f" (nominal model: {number_text(ratio, 3)})"


def identified_sentence(result: Entry) -> str:
    """Sentence on the parameters that the runs do or do not determine; empty if forced."""
    entries: Entry = result["parameters"]
    if result.get("forced"):
        return ""
    unknown = [name for name, entry in entries.items() if not entry["identified"]]
    given = [name for name, entry in entries.items() if known_only_from(entry)]
    if given:
        verb = "is" if len(unknown) == 1 else "are"
        rest = f"; {listed(unknown)} {verb} not identified at all" if unknown else ""
        return (
            f"The runs do not determine {listed(given)}; the value comes only from the given "
            f"knowledge (known values, nameplate){rest}."
        )
    is_open = is_incomplete(result) and len(unknown) < len(entries)
    doubt = "; an interval may not contain the true value" if is_open else ""
    if unknown:
        treated = "its value" if len(unknown) == 1 else "their values"
        sentence = f"The runs do not determine {listed(unknown)}; treat {treated} as unknown."
        return f"{sentence} The model is incomplete{doubt}." if is_open else sentence
    which = " of this incomplete model" if is_open else ""
    return f"The runs determine all {len(entries)} parameters{which}{doubt}."


def is_incomplete(result: Entry) -> bool:
    """True if the final model leaves more than sensor noise on the training runs."""
    remaining = result["diagnosis"].get("remaining") or {}
    return any(
        not check["passed"] and check["role"] == "training" for check in remaining.get("checks", [])
    )


def _given(result: Entry) -> str:
    """Sentence on known values of the user that the intervals include."""
    entries: Entry = result["parameters"]
    used = [name for name, entry in entries.items() if (entry.get("prior") or {}).get("used")]
    if not used:
        return ""
    return f"The intervals include the given knowledge (known values, nameplate) of {listed(used)}."


def deciding_errors(result: Entry) -> tuple[str, Entry]:
    """Errors of the final model on the validation runs; on the training runs if there are none.

    Validation runs that are all identical to training runs do not count.
    """
    after: Entry = result["errors"]["after"]
    validation = after.get("validation")
    checked = [run for run in result["runs"] if run["role"] == "validation"]
    if all(_was_fitted(run, result["runs"]) for run in checked):
        validation = None
    if validation and any(item and item["rmse"] is not None for item in validation.values()):
        return "validation", validation
    return "training", after.get("training") or {}
