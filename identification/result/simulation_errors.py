"""Simulation errors of the result, and warnings on errors larger than the sensor noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.diagnosis.outliers import outlying_run_warnings, root_mean_square
from identification.diagnosis.residual import pooled_errors
from identification.fit.evaluate import Simulated
from identification.result.entries import NEAR_NOISE, finite_or_null
from identification.result.findings import CHANNELS, Findings
from identification.warning import ResultWarning

__all__ = [
    "UNEXPLAINED_CHANNEL",
    "error_entries",
    "missed_channels",
    "unexplained_channels",
    "worse_runs",
    "worse_warnings",
]

Errors = dict[str, dict[str, float | None]]

UNEXPLAINED_CHANNEL: Final = "unexplained_channel"
"""Code of the warnings on a channel whose error exceeds the sensor noise."""
_NOTHING: Final = 0.9
"""NRMSE above which a model explains nothing of a channel [-]."""
_BEYOND_NOISE: Final = 2.0
_CODE: Final = "effects_predict_worse"
_WORSE_FIX: Final = (
    "predict this run with --declared, or add it to the training runs, so that the search can find "
    "the missing effect"
)
_WORSE: Final = 1.05
"""Error ratio above which an increase is reported; both models see the same noise, so it is not
scatter."""


def error_entries(findings: Findings) -> dict[str, dict[str, Errors | None]]:
    """Member ``errors`` of the result, by ``before`` or ``after`` and by role of the runs."""
    return {
        stage: {role: _errors(simulated, findings.noise) for role, simulated in by_role.items()}
        for stage, by_role in findings.simulated.items()
    }


def missed_channels(findings: Findings) -> list[ResultWarning]:
    """Warnings on channels that the final model does not explain although they exceed the noise.

    White residuals of all channels that are as large as the signals themselves are no sensor noise
    either: with samples too far apart, every sample is unrelated to the one before.
    """
    simulated = findings.simulated["after"]["training"]
    errors = _errors(simulated, findings.noise) or {}
    is_nothing = _explains_nothing(simulated)
    return [
        ResultWarning(
            UNEXPLAINED_CHANNEL,
            "critical",
            f"the model does not explain the {channel} of the training runs: the NRMSE is "
            f"{100.0 * (entry['nrmse'] or 0.0):.3g} % (limit {100.0 * _NOTHING:.3g} %) and the "
            f"RMSE is {entry['noise_ratio']:.3g} times the sensor noise, so no parameter counts as "
            "identified",
            "check signs, units, columns and the sample interval of the runs",
        )
        for channel, entry in errors.items()
        if (entry["nrmse"] or 0.0) > _NOTHING
        and (is_nothing or (entry["noise_ratio"] or 0.0) > _BEYOND_NOISE)
    ]


def _explains_nothing(simulated: Sequence[Simulated]) -> bool:
    """Whether the errors of all fitted channels are as large as the measured signals."""
    errors, signals = np.zeros(2), np.zeros(2)
    for one in simulated:
        errors += np.sum(one.record.weight * one.residual**2, axis=0)
        signals += np.sum(one.record.weight * one.record.measured**2, axis=0)
    return bool(np.all(errors[signals > 0.0] > _NOTHING**2 * signals[signals > 0.0]))


def unexplained_channels(findings: Findings) -> list[ResultWarning]:
    """Warnings on what the final model leaves unexplained, and on outlying runs."""
    if not findings.options.effects:
        return _unsearched(findings)
    if findings.after is None or findings.left is None or not findings.after.missing:
        return []
    warnings = []
    for role, simulated in findings.simulated["after"].items():
        errors = _errors(simulated, findings.noise) or {}
        for channel, entry in errors.items():
            ratio = entry["noise_ratio"]
            checks = [c for c in findings.after.of(channel, role) if c.is_too_large]
            if ratio is not None and checks:
                off = max(ratio, checks[0].noise_ratio)
                message = (
                    f"the model does not explain the {channel} on the {role} runs: the residual is "
                    f"{off:.4g} times the sensor noise (limit {checks[0].noise_ratio_limit:.4g})"
                )
                warnings.append(ResultWarning(UNEXPLAINED_CHANNEL, "warning", message))
    odd = outlying_run_warnings(findings.simulated["after"]["training"], findings.noise)
    sentence = findings.after.sentence.removesuffix(".")
    other = ResultWarning("residual_not_noise", "warning", sentence)
    return (warnings or [other]) + odd


def _unsearched(findings: Findings) -> list[ResultWarning]:
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
        for role, simulated in findings.simulated["after"].items()
        for channel, entry in (_errors(simulated, findings.noise) or {}).items()
        if (entry["noise_ratio"] or 0.0) > NEAR_NOISE
    ]


def worse_runs(findings: Findings) -> list[ResultWarning]:
    """Warnings on validation runs that the nominal model predicts better."""
    if findings.outcome is None or not findings.outcome.effects:
        return []
    before, after = (findings.simulated[stage]["validation"] for stage in ("before", "after"))
    names = [found.name for found in findings.outcome.effects]
    return worse_warnings(before, after, findings.noise, names)


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


def _errors(simulated: Sequence[Simulated], noise: Array) -> Errors | None:
    if not simulated:
        return None
    entries: Errors = {}
    for channel, name in enumerate(CHANNELS):
        kept = [s.record.weight[:, channel] > 0 for s in simulated]
        if not any(mask.any() for mask in kept):
            entries[name] = {"rmse": None, "nrmse": None, "noise_ratio": None}
            continue
        pairs = [(s, mask) for s, mask in zip(simulated, kept, strict=True) if mask.any()]
        errors = pooled_errors(
            [s.residual[mask, channel] for s, mask in pairs],
            [s.record.measured[mask, channel] for s, mask in pairs],
        )
        ratio = errors.rmse / noise[channel] if noise[channel] > 0 else np.nan
        entries[name] = {
            "rmse": finite_or_null(errors.rmse),
            "nrmse": finite_or_null(errors.nrmse),
            "noise_ratio": finite_or_null(ratio),
        }
    return entries
