"""Simulation errors of the result, and warnings on errors larger than the sensor noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.diagnosis.outliers import outlying_run_warnings, root_mean_square
from identification.effects.effect import AbstractRunEffect, effects_of, runs_text
from identification.fit.evaluate import Simulated
from identification.result.effect_texts import effect_words
from identification.result.entries import NEAR_NOISE, NOTHING
from identification.result.findings import (
    CHANNELS,
    Errors,
    ResidualAnalysis,
    channel_errors,
)
from identification.result.numbers import listed, number_text, percent_text
from identification.selection.outcome import Outcome
from identification.warning import ResultWarning

__all__ = [
    "UNEXPLAINED_CHANNEL",
    "error_entries",
    "missed_channels",
    "unexplained_channels",
    "worse_runs",
    "worse_warnings",
]

UNEXPLAINED_CHANNEL: Final = "unexplained_channel"
"""Code of the warnings on a channel whose error exceeds the sensor noise."""
_CODE: Final = "effects_predict_worse"
_WORSE_FIX: Final = (
    "predict this run with --declared, or add it to the training runs, so that the search can find "
    "the missing effect"
)
_NOISIER_FIX: Final = (
    "the residual is white, as the noise of a sensor that is noisier in these runs; check its "
    "range, filter and cable"
)
_UNSEEN_FIX: Final = (
    "record a validation run in the condition in which the training runs show it, such as the "
    "temperature, the load or the speed"
)
_WORSE: Final = 1.05
"""Error ratio above which an increase is reported; both models see the same noise, so it is not
scatter."""


def error_entries(analysis: ResidualAnalysis) -> dict[str, dict[str, Errors | None]]:
    """Member ``errors`` of the result, by ``before`` or ``after`` and by role of the runs."""
    return {
        stage: {role: channel_errors(one, analysis.noise) for role, one in by_role.items()}
        for stage, by_role in analysis.simulated.items()
    }


def missed_channels(analysis: ResidualAnalysis) -> list[ResultWarning]:
    """Warnings on the channels of which the final model explains nothing."""
    return [
        ResultWarning(
            UNEXPLAINED_CHANNEL,
            "critical",
            f"the model does not explain the {channel} of the training runs: the NRMSE is "
            f"{percent_text(entry['nrmse'])} (limit {percent_text(NOTHING)}) and the RMSE is "
            f"{number_text(entry['noise_ratio'], 3)} times the sensor noise, so no parameter "
            "counts as identified and no probability of an effect applies",
            "check signs, units, columns and the sample interval of the runs",
        )
        for channel, entry in analysis.missed.items()
    ]


def unexplained_channels(analysis: ResidualAnalysis) -> list[ResultWarning]:
    """Warnings on what the final model leaves unexplained, and on outlying runs."""
    if analysis.outcome is None:
        return _unsearched(analysis)
    if analysis.after is None or analysis.left is None or not analysis.after.missing:
        return []
    warnings = []
    for role, simulated in analysis.simulated["after"].items():
        errors = channel_errors(simulated, analysis.noise) or {}
        for channel, entry in errors.items():
            ratio = entry["noise_ratio"]
            checks = [c for c in analysis.after.of(channel, role) if c.is_too_large]
            if ratio is not None and checks:
                off = max(ratio, checks[0].noise_ratio)
                message = (
                    f"the model does not explain the {channel} on the {role} runs: the residual is "
                    f"{off:.4g} times the sensor noise (limit {checks[0].noise_ratio_limit:.4g})"
                )
                is_noisier = role == "validation" and channel in analysis.after.noisier
                fix = _NOISIER_FIX if is_noisier else ""
                warnings.append(ResultWarning(UNEXPLAINED_CHANNEL, "warning", message, fix))
    odd = outlying_run_warnings(analysis.simulated["after"]["training"], analysis.noise)
    sentence = analysis.after.sentence.removesuffix(".")
    other = ResultWarning("residual_not_noise", "warning", sentence)
    return (warnings or [other]) + odd


def _unsearched(analysis: ResidualAnalysis) -> list[ResultWarning]:
    """Warnings on channels whose error exceeds the noise when no effect search was made."""
    return [
        ResultWarning(
            UNEXPLAINED_CHANNEL,
            "warning",
            f"the nominal model does not explain the {channel} of the {role} runs: the RMSE is "
            f"{entry['noise_ratio']:.3g} times the sensor noise (limit {NEAR_NOISE:.3g}), and its "
            "parameters are biased",
            "run the effect search (fit without --no-effects)",
            "effects",
        )
        for role, simulated in analysis.simulated["after"].items()
        for channel, entry in (channel_errors(simulated, analysis.noise) or {}).items()
        if (entry["noise_ratio"] or 0.0) > NEAR_NOISE
    ]


def worse_runs(analysis: ResidualAnalysis) -> list[ResultWarning]:
    """Warnings on validation runs that the nominal model predicts better."""
    if analysis.outcome is None or not analysis.outcome.effects:
        return []
    before, after = (analysis.simulated[stage]["validation"] for stage in ("before", "after"))
    names = [found.name for found in analysis.outcome.effects]
    return [
        *worse_warnings(before, after, analysis.noise, names),
        *_unconfirmed_effects(analysis.outcome),
        *_changed_runs(analysis, after),
    ]


def _unconfirmed_effects(outcome: Outcome) -> list[ResultWarning]:
    """Note on the effects that the validation runs cannot show."""
    criteria = {found.name: found.criteria for found in outcome.effects}
    names = [
        effect_words(name)
        for name, one in criteria.items()
        if one.validation is not None and not (one.local or one.is_judged)
    ]
    if not names:
        return []
    message = (
        f"the validation runs can neither confirm nor refute {listed(names)}: in their conditions "
        "it changes the simulation by less than the noise"
    )
    return [ResultWarning("effect_not_validated", "note", message, _UNSEEN_FIX)]


def _changed_runs(
    analysis: ResidualAnalysis, validation: Sequence[Simulated]
) -> list[ResultWarning]:
    """Notes on validation runs that have a change of several training runs, as a disk."""
    terms = effects_of(analysis.final.simulator.model.terms)
    alike = {s.record.name: float(s.record.column("run")[0]) for s in validation}
    own = {s.record.name: s.record.run for s in validation}
    return [
        ResultWarning(
            "change_in_validation",
            "note",
            f"{name}: its samples show the {term.name} of {runs_text(term.runs)}, with which it is "
            "simulated; predictions and step responses are without it",
        )
        for name, run in alike.items()
        for term in terms
        if run != own[name] and isinstance(term, AbstractRunEffect) and run == term.runs[0]
    ]


def worse_warnings(
    before: Sequence[Simulated], after: Sequence[Simulated], noise: Array, effects: Sequence[str]
) -> list[ResultWarning]:
    """One warning for each run and channel whose error increases with the effects.

    The same validation records, simulated by the nominal and by the final model; noise (2,) [A,
    rad/s].
    """
    found = []
    for run in dict.fromkeys(one.record.name for one in after):
        nominal = root_mean_square([one for one in before if one.record.name == run])
        final = root_mean_square([one for one in after if one.record.name == run])
        for channel, name in enumerate(CHANNELS):
            is_divergent = np.isfinite(nominal[channel]) and not np.isfinite(final[channel])
            limit = _WORSE * max(nominal[channel], noise[channel])
            if not (is_divergent or final[channel] > limit):
                continue
            ratio, declared = final[channel] / noise[channel], nominal[channel] / noise[channel]
            message = f"{_CODE}: {run}: with {', '.join(effects)} " + (
                f"the simulation of the {name} diverges; the RMSE with the nominal model is "
                f"{declared:.3g} times the sensor noise"
                if is_divergent
                else f"the RMSE of the {name} is {ratio:.3g} times the sensor noise, with the "
                f"nominal model {declared:.3g} times"
            )
            found.append(ResultWarning(_CODE, "warning", message, _WORSE_FIX, "declared"))
    return found
