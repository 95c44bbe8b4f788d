"""First screen of a report: facts, three sentences, effects and their evidence, warnings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from identification.reporting.loops import cold_and_hot, is_left_open, pair_text, single_text
from identification.reporting.summary import (
    DOWN_TO_NOISE,
    POOR_FIT,
    deciding_errors,
    identified_sentence,
    is_incomplete,
    verdict_words,
)
from identification.result.effect_texts import (
    alternative_texts,
    certain_effects,
    doubt_sentence,
    effect_details,
    effect_probability,
    effect_words,
    is_surrogate,
)
from identification.result.entries import NEAR_NOISE, Entry, known_only_from
from identification.result.numbers import (
    count_text,
    entry_text,
    listed,
    number_text,
    percent_text,
    signed_percent_text,
    unit_prefix,
    unit_text,
)
from identification.result.report_data import CandidateRow, ReportData, SearchAccount

__all__ = ["KeyFigure", "effect_tiles", "error_bars", "facts", "headline_sentences", "key_figures"]


@dataclass(frozen=True)
class KeyFigure:
    """One number with its label and a remark; ``tone`` is good, fair, bad or plain."""

    label: str
    value: str
    remark: str
    tone: str = "plain"


def facts(data: ReportData) -> list[tuple[str, str]]:
    """Label and text of the origin of the result: motor, date, runs, options and software."""
    result = data.result
    options: Entry = result.get("options") or {}
    runs: Sequence[Entry] = result["runs"]
    roles = [run["role"] for run in runs]
    rows = sum(int(run["rows"]) for run in runs)
    counts = f"{roles.count('training')} training, {roles.count('validation')} validation"
    label: Entry = result.get("label") or {}
    found = [
        ("Motor", label.get("motor", "")),
        ("Bench", label.get("bench", "")),
        ("Date", data.created),
        ("Runs", f"{counts}; {count_text(rows)} samples"),
        ("Options", _options_text(options)),
        ("Software", f"motorid {result['software']['motorid']}"),
    ]
    return [(label, text) for label, text in found if text]


def _options_text(options: Entry) -> str:
    """Options in the words of the command line, defaults included where they matter."""
    if not options:
        return ""
    words = [f"effort {options.get('effort', 'normal')}", f"hold {options.get('hold', 'auto')}"]
    words += ["no effect search"] if options.get("effects") is False else []
    words += ["no posterior"] if options.get("posterior") is False else []
    words += [f"time limit {options['time_limit']:g} s"] if options.get("time_limit") else []
    words += [f"known {value}" for value in options.get("known") or ()]
    words += [f"nameplate {options['nameplate']}"] if options.get("nameplate") else []
    return ", ".join([*words, f"seed {options.get('seed', 0)}"])


def headline_sentences(result: Entry, coloured: Sequence[str] = ()) -> list[str]:
    """Up to three sentences: the effects found, the quality of the model, the parameters.

    `coloured` names the channels whose residual is not white on the deciding runs.
    """
    role, _ = deciding_errors(result)
    verdict = verdict_words(result, coloured).removeprefix("but ")
    quality = f"On the {role} runs, {verdict}." if verdict else ""
    sentences = [_effects_sentence(result), quality, identified_sentence(result)]
    if result.get("forced"):
        forced = "The runs contradict the motor equations or each other, and the fit was forced."
        sentences = [forced, "Do not rely on any number below.", quality]
    return list(filter(None, sentences))


def _effects_sentence(result: Entry) -> str:
    found, doubt = certain_effects(result), doubt_sentence(result, _described)
    if found:
        parts = listed([_described(effect) for effect in found])
        noun = "an effect" if len(found) == 1 else f"{len(found)} effects"
        sentence = f"The motor has {noun} beyond the nominal model: {parts}."
    elif doubt:
        return doubt
    elif (result.get("options") or {}).get("effects") is False:
        sentence = "No effects were searched: the nominal model is final."
    else:
        sentence = "No effect beyond the nominal model was found."
    return f"{sentence} {doubt}" if doubt else sentence


def _described(effect: Entry) -> str:
    return f"{_with_equals(effect)} ({effect_details(effect)})"


def _with_equals(effect: Entry) -> str:
    """Name of an effect, and those of the alternatives that are at least as probable."""
    others = effect.get("alternatives") or ()
    equals = [one["name"] for one in others if one["probability"] >= effect["probability"]]
    names = [effect["name"], *(name for name in equals if name != "unlisted")]
    return " or ".join(effect_words(name) for name in names)


def effect_tiles(data: ReportData) -> list[Entry]:
    """Effects of the final model in words, strongest evidence first, with what they explain.

    `is_certain` is true of the effects that the first sentence attributes to the motor.  `term` is
    the missing voltage or torque against its driver, `trace` that over time; None if not computed.
    """
    account, certain = data.account or SearchAccount(), certain_effects(data.result)
    return [
        dict(
            is_certain=effect in certain,
            name=effect_words(effect["name"]).capitalize(),
            place=_place(effect),
            probability=effect_probability(effect),
            amount=_amount(effect["parameters"]),
            evidence=_evidence(effect["name"], account.candidates),
            alternatives=listed(alternative_texts(effect)),
            term=next((one for one in account.terms if one.effect == effect["name"]), None),
            trace=next((one for one in account.traces if one.effect == effect["name"]), None),
        )
        for effect in data.result["effects"]
    ]


def _place(effect: Entry) -> str:
    variant = f" ({effect['variant']})" if effect.get("variant") else ""
    kind = "surrogate in the " if is_surrogate(effect) else ""
    where = f"{kind}{effect['equation']} equation{variant}"
    return f"{where}, function of {listed(effect['drivers'])}" if effect["drivers"] else where


def _amount(parameters: Entry) -> str:
    """First parameter of an effect, which is its amplitude, with its interval."""
    if not parameters:
        return ""
    name, entry = next(iter(parameters.items()))
    factor, unit = unit_prefix(entry["unit"], [entry[key] for key in ("median", "q05", "q95")])
    text = entry_text(entry, factor)
    written = f"{name.rpartition('.')[2]} {text.median}{text.power} {unit_text(unit)}".rstrip()
    return written if text.low == text.high else f"{written} ({text.low} … {text.high})"


def _evidence(name: str, candidates: Sequence[CandidateRow]) -> tuple[tuple[str, str], ...]:
    for candidate in candidates:
        if candidate.name == name and candidate.verdict == "chosen":
            explained = None if candidate.explained is None else -candidate.explained
            changes = (("training", explained), ("validation", candidate.validation))
            return tuple(
                (f"Squared error, {role}", signed_percent_text(change))
                for role, change in changes
                if change is not None
            )
    return ()


def error_bars(result: Entry, coloured: Sequence[str] = ()) -> list[Entry]:
    """Noise ratios of the deciding runs before and after, all on one scale.

    `coloured` names the channels whose residual is not white on these runs.  Widths of bars and
    position of the noise are in per cent of the scale.
    """
    role, errors = deciding_errors(result)
    earlier = (result["errors"]["before"].get(role) or {}) if result["effects"] else {}
    ratios = {
        channel: ((earlier.get(channel) or {}).get("noise_ratio"), errors[channel]["noise_ratio"])
        for channel in ("current", "speed")
        if errors.get(channel)
    }
    top = max([1.25, *(ratio for pair in ratios.values() for ratio in pair if ratio is not None)])
    nrmse = {channel: errors[channel]["nrmse"] for channel in ratios}
    return [
        dict(
            channel=channel,
            role=role,
            before="" if before is None else number_text(before, 3),
            after=number_text(after, 3),
            fit="" if nrmse[channel] is None else f"{percent_text(1.0 - nrmse[channel], 4)} fit",
            widths=(_width(before, top), _width(after, top), _width(1.0, top)),
            tone="bad" if (nrmse[channel] or 0.0) > POOR_FIT else _tone(after, channel in coloured),
        )
        for channel, (before, after) in ratios.items()
    ]


def _width(ratio: float | None, top: float) -> float:
    return 0.0 if ratio is None else round(min(max(100.0 * ratio / top, 0.0), 100.0), 1)


def key_figures(result: Entry) -> list[KeyFigure]:
    """Number of identified parameters, and figures of one speed loop cold and hot.

    The loop is that of the controller that suits the motor, or of the first one without it.
    """
    entries = result["parameters"].values()
    known = sum(1 for entry in entries if entry["identified"] and not known_only_from(entry))
    is_open = is_incomplete(result)
    remark = "of an incomplete model" if is_open else ""
    tone = "good" if known == len(entries) and not is_open else "fair"
    count = KeyFigure("Parameters identified", f"{known} of {len(entries)}", remark, tone)
    return [count, *_loop_figures(result)]


def _loop_figures(result: Entry) -> list[KeyFigure]:
    suited = result.get("feedback_suited") or []
    ends = cold_and_hot(suited or result["feedback"])
    if ends is None:
        return []
    cold, hot = ends
    name = f"proposed {cold['controller']}" if suited else cold["controller"]
    remark = f"{cold['temperature_degC']:g} → {hot['temperature_degC']:g} °C, {name}"

    def figure(key: str, label: str, unit: str) -> KeyFigure:
        if not is_left_open(result, ends, key):
            return KeyFigure(label, pair_text(cold[key], hot[key], " → ", unit), remark)
        if is_left_open(result, [cold], key):
            return KeyFigure(label, "not determined", remark, "fair")
        texts = [f"{end['temperature_degC']:g} °C" for end in ends]
        at_cold = f"at {texts[0]}, {name}; not determined at {texts[1]}"
        return KeyFigure(label, single_text(cold[key], unit), at_cold, "fair")

    final = ("steady_state", "Final value", "")
    second = ("overshoot_percent", "Overshoot", "%") if suited else final
    return [figure("rise_time_s", "Rise time", "s"), figure(*second)]


def _tone(ratio: float | None, is_coloured: bool) -> str:
    if ratio is None:
        return "plain"
    if is_coloured:
        return "fair" if ratio <= NEAR_NOISE else "bad"
    return "good" if ratio <= DOWN_TO_NOISE else "fair" if ratio <= NEAR_NOISE else "bad"
