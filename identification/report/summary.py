"""Summary of the result in plain words, and its key figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from identification.report.numbers import (
    UNKNOWN,
    count_text,
    interval_text,
    number_text,
    percent_text,
    probability_text,
)
from identification.report.result import known_only_from

__all__ = ["NEAR_NOISE", "KeyFigure", "key_figures", "summary_sentences"]

Entry = Mapping[str, Any]

_DOWN_TO_NOISE = 1.02
NEAR_NOISE = 1.10
"""Noise ratio (simulation error over sensor noise) above which the model is incomplete [-]."""
_NAMED = 2
_HALF = 0.5
"""NRMSE above which a fit is poor regardless of its noise ratio [-]."""
_WIDE = 0.2
"""Relative width of the 90 % interval above which a closed-loop figure is no prediction [-]."""


@dataclass(frozen=True)
class KeyFigure:
    """One number with its label and a remark; ``tone`` is good, fair, bad or plain."""

    label: str
    value: str
    remark: str
    tone: str = "plain"


def summary_sentences(result: Entry, coloured: Sequence[str] = ()) -> list[str]:
    """Summary of the data, the effects, the fit quality, the parameters and the closed loop.

    Args:
        result: Content of result.json.
        coloured: Channels whose residual is not white on the deciding runs.
    """
    sentences = [
        _forced(result),
        _campaign(result["runs"]),
        _effects(result),
        _shifted(result),
        _quality(result, coloured),
        _identified(result),
        _given(result),
        _loop(result),
    ]
    return [sentence for sentence in sentences if sentence]


def key_figures(result: Entry, coloured: Sequence[str] = ()) -> list[KeyFigure]:
    """Noise ratios, number of identified parameters, and closed-loop figures cold and hot.

    Args:
        result: Content of result.json.
        coloured: Channels whose residual is not white on the deciding runs.
    """
    role, errors = _deciding_errors(result)
    figures = [
        KeyFigure(
            f"{channel.capitalize()} error, {role}",
            f"{number_text(errors[channel]['noise_ratio'], 3)} × noise",
            f"{percent_text(1.0 - errors[channel]['nrmse'], 4)} fit"
            if errors[channel]["nrmse"] is not None
            else "",
            "bad"
            if (errors[channel]["nrmse"] or 0.0) > _HALF
            else _tone(errors[channel]["noise_ratio"], channel in coloured),
        )
        for channel in ("current", "speed")
        if errors.get(channel)
    ]
    entries = result["parameters"].values()
    known = sum(1 for entry in entries if entry["identified"] and not known_only_from(entry))
    figures.append(
        KeyFigure(
            "Parameters identified",
            f"{known} of {len(entries)}",
            "",
            "good" if known == len(entries) else "fair",
        )
    )
    return figures + _loop_figures(result)


def _loop_figures(result: Entry) -> list[KeyFigure]:
    ends = _cold_and_hot(result["feedback"])
    if ends is None:
        return []
    cold, hot = ends
    remark = f"{cold['temperature_degC']:g} → {hot['temperature_degC']:g} °C, {cold['controller']}"
    return [
        KeyFigure(label, "not determined", remark, "fair")
        if _is_left_open(result, ends, key)
        else KeyFigure(label, f"{_median(cold[key])} → {_median(hot[key])}{unit}", remark)
        for key, label, unit in (
            ("rise_time_s", "Rise time", " s"),
            ("steady_state", "Final value", ""),
        )
    ]


def _forced(result: Entry) -> str:
    """Warning on a forced fit, which the checks would have refused."""
    if not result.get("forced"):
        return ""
    return (
        "The runs contradict physics or each other and were fitted by force: no number below is to "
        "be relied on (see Warnings)."
    )


def _campaign(runs: Sequence[Entry]) -> str:
    fitted = [run for run in runs if run["role"] == "training"]
    checked = [run for run in runs if run["role"] == "validation"]
    sentence = f"The model was fitted to {_runs_and_rows(fitted)}"
    if not checked:
        return f"{sentence}; no run was kept aside to check it."
    seen = sum(_was_fitted(run, runs) for run in checked)
    if seen == len(checked):
        which = "the run" if seen == 1 else f"the {seen} runs"
        return f"{sentence}; {which} given to check it had been fitted too, so nothing checks it."
    if seen:
        return (
            f"{sentence} and checked on {_runs_and_rows(checked)}, {seen} of which it had been "
            "fitted to as well."
        )
    return f"{sentence} and checked on {_runs_and_rows(checked)} that it had not seen."


def _was_fitted(run: Entry, runs: Sequence[Entry]) -> bool:
    """Whether a run holds the same samples as a training run."""
    place = run.get("same_as")
    return place is not None and runs[place]["role"] == "training"


def _runs_and_rows(runs: Sequence[Entry]) -> str:
    rows = sum(int(run["rows"]) for run in runs)
    noun = "run" if len(runs) == 1 else "runs"
    return f"{len(runs)} {noun} with {count_text(rows)} samples"


def _effects(result: Entry) -> str:
    parts = []
    for effect in result["effects"]:
        drivers = f", depending on {_list(effect['drivers'])}" if effect["drivers"] else ""
        name = effect["name"].replace("_", " ")
        part = f"{name} in the {effect['equation']} equation{drivers}"
        chances = [f"probability {probability_text(effect['probability'])}"]
        chances += [
            f"{item['name'].replace('_', ' ')} instead {probability_text(item['probability'])}"
            for item in effect["alternatives"]
        ]
        part += f" ({', '.join(chances)})"
        parts.append(part)
    return f"The declared model lacked {'; and '.join(parts)}." if parts else ""


def _shifted(result: Entry) -> str:
    """Sentence on the parameters that the missing effects biased most."""
    shifts = (result["diagnosis"].get("shifts") or {}).items()
    medians = {
        name: shift["relative"]["median"]
        for name, shift in shifts
        if shift["off"] and shift["relative"]["median"] is not None
    }
    worst = sorted(medians, key=lambda name: -abs(medians[name]))[:_NAMED]
    if not worst:
        return ""
    told = [
        f"{name} comes out {percent_text(abs(medians[name]), 2)} too "
        f"{'high' if medians[name] > 0 else 'low'}"
        for name in worst
    ]
    return f"Without {'it' if len(result['effects']) == 1 else 'them'}, {_list(told)}."


def _quality(result: Entry, coloured: Sequence[str]) -> str:
    role, errors = _deciding_errors(result)
    ratios = {
        channel: errors[channel]["noise_ratio"]
        for channel in ("current", "speed")
        if errors.get(channel) and errors[channel]["noise_ratio"] is not None
    }
    if not ratios:
        return ""
    before = (result["errors"]["before"].get(role) or {}) if result["effects"] else {}
    told = _list(
        [
            f"{number_text(ratio, 3)} in {name}{_formerly(before.get(name))}"
            for name, ratio in ratios.items()
        ]
    )
    verdict = _verdict(result, max(ratios.values()), coloured)
    missed = _unexplained(errors)
    if missed:
        verdict = (
            f"yet the model explains little of {missed}: it is no model of these runs, or the "
        )
        verdict += "sensor gives mostly noise"
    return f"On the {role} runs the simulation error over the sensor noise is {told}: {verdict}."


def _unexplained(errors: Entry) -> str:
    """Channels whose NRMSE exceeds one half, with the error."""
    told = [
        f"the {channel} (off by {percent_text(errors[channel]['nrmse'], 3)} of its movement)"
        for channel in ("current", "speed")
        if errors.get(channel) and (errors[channel]["nrmse"] or 0.0) > _HALF
    ]
    return _list(told)


def _verdict(result: Entry, worst: float, coloured: Sequence[str]) -> str:
    """Interpretation of the noise ratio together with the other residual tests."""
    remaining = result["diagnosis"].get("remaining") or {}
    failed = {check["role"] for check in remaining.get("checks", []) if not check["passed"]}
    if failed == {"validation"}:
        return (
            "the training runs are explained, so the validation runs hold something that none of "
            "them does, in the motor, its load or a sensor"
        )
    if worst > NEAR_NOISE and (failed or not remaining):
        return "something is at work that the model does not contain, in the motor or in a sensor"
    if worst <= NEAR_NOISE and coloured:
        # If the noise is estimated from the same residuals, a ratio of 1 proves nothing.
        return (
            f"yet the residual of {_list(coloured)} is not white, so either the sensor is slow or "
            "the model misses something (see Residuals)"
        )
    if failed:
        return "yet the training runs are not explained to their noise"
    if worst <= (NEAR_NOISE if remaining else _DOWN_TO_NOISE):
        return "that is as close as the sensors can tell"
    if worst <= NEAR_NOISE:
        return "a small part of the error is more than sensor noise"
    return "that is within what so few samples scatter"


def _formerly(error: Entry | None) -> str:
    ratio = error["noise_ratio"] if error else None
    return "" if ratio is None else f" (declared model {number_text(ratio, 3)})"


def _identified(result: Entry) -> str:
    entries: Entry = result["parameters"]
    if result.get("forced"):
        return ""
    unknown = [name for name, entry in entries.items() if not entry["identified"]]
    given = [name for name, entry in entries.items() if known_only_from(entry)]
    if given:
        rest = f"; nothing determines {_list(unknown)}" if unknown else ""
        return (
            f"The data do not determine {_list(given)}, known from what was given and not from the "
            f"runs{rest}."
        )
    if unknown:
        return (
            f"The data do not determine {_list(unknown)}; what is shown for "
            f"{'it' if len(unknown) == 1 else 'them'} is not a measurement."
        )
    return f"All {len(entries)} parameters are determined by the data."


def _given(result: Entry) -> str:
    """Sentence on known values of the user that the intervals include."""
    entries: Entry = result["parameters"]
    used = [name for name, entry in entries.items() if (entry.get("prior") or {}).get("used")]
    if not used:
        return ""
    return f"The values given for {_list(used)} were used, and the intervals include them."


def _loop(result: Entry) -> str:
    ends = _cold_and_hot(result["feedback"])
    if ends is None:
        return ""
    cold, hot = ends
    told = {
        "rise_time_s": f"the rise time from {_median(cold['rise_time_s'])} to "
        f"{_median(hot['rise_time_s'])} s",
        "steady_state": f"the final value from {_median(cold['steady_state'])} to "
        f"{_median(hot['steady_state'])} of the reference",
    }
    left_open = [name for name in told if _is_left_open(result, ends, name)]
    lead = f"With the controller {cold['controller']} in a unity speed loop"
    if len(left_open) == len(told):
        return (
            f"{lead}, these runs do not determine how fast it answers and what it settles at: what "
            "is shown for it is no prediction."
        )
    sentence = (
        f"{lead}, going from {cold['temperature_degC']:g} °C to {hot['temperature_degC']:g} °C "
        f"takes {_list([told[name] for name in reversed(told) if name not in left_open])}"
    )
    words = {"rise_time_s": "how fast it answers", "steady_state": "what it settles at"}
    return "; these runs do not determine ".join([sentence, *(words[n] for n in left_open)]) + "."


def _is_left_open(result: Entry, ends: Sequence[Entry], name: str) -> bool:
    """Whether a closed-loop figure is uncertain because a parameter is not identified.

    If all parameters are identified, a wide interval is still a measurement.
    """
    if all(entry["identified"] for entry in result["parameters"].values()):
        return False
    entries = [end[name] for end in ends if end.get(name) and end[name]["median"] is not None]
    return any(
        entry["q95"] is None or entry["q95"] - entry["q05"] > _WIDE * abs(entry["median"])
        for entry in entries
    )


def _deciding_errors(result: Entry) -> tuple[str, Entry]:
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


def _cold_and_hot(feedback: Sequence[Entry]) -> tuple[Entry, Entry] | None:
    """Coldest and hottest entry of the first controller; None with fewer than two temperatures."""
    if not feedback:
        return None
    first = [entry for entry in feedback if entry["controller"] == feedback[0]["controller"]]
    ordered = sorted(first, key=lambda entry: float(entry["temperature_degC"]))
    return (ordered[0], ordered[-1]) if len(ordered) > 1 else None


def _median(entry: Entry | None) -> str:
    if entry is None:
        return UNKNOWN
    written = interval_text(entry["median"], entry["q05"], entry["q95"])
    if len(written.median) > 6:
        return number_text(entry["median"], 3)
    return written.median + written.power


def _list(words: Sequence[str]) -> str:
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} and {words[-1]}"


def _tone(ratio: float | None, is_coloured: bool) -> str:
    if ratio is None:
        return "plain"
    if is_coloured:
        return "fair" if ratio <= NEAR_NOISE else "bad"
    return "good" if ratio <= _DOWN_TO_NOISE else "fair" if ratio <= NEAR_NOISE else "bad"
