"""Assembly of result.json from the findings of all stages.

Every number of the result passes through this module once; the report and the command line print
the result and do not recompute it.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from importlib import metadata
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.checks.admission import Admission
from identification.checks.finding import Finding
from identification.checks.time_constants import time_constant_findings
from identification.diagnosis.outliers import outlier_warnings, outlying_run_warnings
from identification.diagnosis.simulation_error import pooled_errors
from identification.feedback.nonlinear import nonlinear_entries
from identification.fit.campaign import Campaign
from identification.fit.evaluate import Simulated
from identification.fit.identifiability import identified
from identification.fit.resolution import coarse_warnings
from identification.fit.solve import Fit
from identification.fit.temperature import estimated_temperatures
from identification.model.unlogged import COLDEST, HOTTEST
from identification.posterior.sample import Sample
from identification.quantities import DECLARED_PARAMETERS, REFERENCE_TEMPERATURE_DEGC
from identification.report.diagnosis import detection_entry, shift_entries, trace_entry
from identification.report.early_ends import early_ends
from identification.report.findings import CHANNELS, Findings
from identification.report.knowledge import (
    contradiction_warnings,
    known_only_warnings,
    prior_entries,
)
from identification.report.omitted import (
    confounded_entries,
    confounded_warnings,
    omitted_entries,
    omitted_warnings,
)
from identification.report.result import parameter_entry
from identification.report.story import effect_entries, searched_entries
from identification.report.summary import NEAR_NOISE
from identification.report.worse import worse_warnings
from identification.selection.non_identifiable import linear_parts_of
from identification.selection.omitted import consider_variances

__all__ = ["assemble"]

Array = NDArray[np.float64]

_NOTHING = 0.9
"""NRMSE above which a model explains nothing of a channel [-]."""
_BEYOND_NOISE = 2.0
_MOST_NAMED = 12
"""Largest number of runs that a warning on temperatures names."""


def assemble(findings: Findings) -> dict[str, object]:
    """Content of result.json, schema version 1."""
    final, declared = findings.final, findings.declared
    sample = findings.sample
    known = identified(declared, findings.fraction)
    before = _parameters(declared, findings.declared_draws, known, findings)
    after = _parameters(final, findings.draws, findings.known, findings)
    implausible = _implausible(findings)
    missed = _missed(findings)
    if missed:
        after = {name: entry | {"identified": False} for name, entry in after.items()}
    return {
        "schema_version": 1,
        "software": _software(),
        "options": _options(findings),
        "runs": _runs(findings.campaign),
        **_checks(findings.admission, implausible),
        "declared": {"parameters": before},
        "parameters": after,
        "effects": effect_entries(findings.outcome, final, findings.draws, findings.known),
        "diagnosis": {
            "residual": detection_entry(findings.before),
            "trace": trace_entry(
                findings.localisation, findings.outcome, declared.simulator.records
            ),
            "searched": searched_entries(findings.outcome),
            "omitted": omitted_entries(final, findings.omitted),
            "confounded": confounded_entries(final, findings.omitted),
            "remaining": detection_entry(findings.after)
            | trace_entry(findings.left, None, declared.simulator.records),
            "shifts": shift_entries(after, before, findings.draws, findings.declared_draws)
            if findings.has_effects
            else {},
        },
        "errors": {
            stage: {role: _errors(simulated, findings.noise) for role, simulated in by_role.items()}
            for stage, by_role in findings.simulated.items()
        },
        "noise": {
            "current_A": _number(findings.noise[0]),
            "speed_rad_s": _number(findings.noise[1]),
        },
        "feedback": findings.feedback,
        "feedback_before": findings.feedback_before,
        "feedback_nonlinear": nonlinear_entries(findings.loops),
        "sampler": None if sample is None else _sampler(sample),
        "warnings": _warnings(findings, [*missed, *map(str, implausible)]),
    }


def _sampler(sample: Sample) -> dict[str, object]:
    """Member ``sampler`` of the result."""
    convergence = sample.convergence
    return {
        "walkers": convergence.walkers,
        "steps": convergence.steps,
        "acceptance": convergence.acceptance,
        "autocorrelation_time": convergence.autocorrelation_time,
        "ess_min": convergence.ess_min,
        "r_hat_max": convergence.r_hat_max,
        "converged": convergence.reached,
        "draws": sample.source,
        "pareto_k": None if sample.shape is None else _number(sample.shape),
    }


def _implausible(findings: Findings) -> list[Finding]:
    """Implausible time constants, computed from identified parameters that the user has not given.

    Effects confounded with a single parameter do not widen its uncertainty here: an inductance is
    reported as implausible even if a sensor lag may explain it.
    """
    final = findings.final
    others = [term for term in findings.omitted if not term.parameter]
    known = identified(final, findings.fraction, consider_variances(final, others))
    given = {p.name for p in final.coordinates.parameters if p.origin} & {"J", "L"}
    values = dict(zip(final.coordinates.names, map(float, final.values), strict=True))
    trusted = {name: known[name] and name not in given for name in DECLARED_PARAMETERS}
    return time_constant_findings(values, trusted)


def _missed(findings: Findings) -> list[str]:
    """Warnings on channels that the final model does not explain although they exceed the noise."""
    errors = _errors(findings.simulated["after"]["training"], findings.noise) or {}
    return [
        f"the model does not explain the {channel} of the training runs: the NRMSE is "
        f"{100.0 * (entry['nrmse'] or 0.0):.3g} % (limit {100.0 * _NOTHING:.3g} %) and the RMSE is "
        f"{entry['noise_ratio']:.3g} times the sensor noise, so no parameter counts as identified; "
        "check signs, units and columns of the runs"
        for channel, entry in errors.items()
        if (entry["nrmse"] or 0.0) > _NOTHING and (entry["noise_ratio"] or 0.0) > _BEYOND_NOISE
    ]


def _missing(findings: Findings) -> list[str]:
    """Warnings on what the final model leaves unexplained, and on outlying runs."""
    if not findings.options.effects:
        return _unsearched(findings)
    if findings.after is None or findings.left is None or not findings.after.missing:
        return []
    messages = []
    for role, simulated in findings.simulated["after"].items():
        errors = _errors(simulated, findings.noise) or {}
        for channel, entry in errors.items():
            ratio = entry["noise_ratio"]
            checks = [c for c in findings.after.of(channel, role) if c.is_too_large]
            if ratio is not None and checks:
                off = max(ratio, checks[0].noise_ratio)
                messages.append(
                    f"the model does not explain the {channel} of the {role} runs: the residual is "
                    f"{off:.4g} times the sensor noise (limit {checks[0].noise_ratio_limit:.4g})"
                )
    odd = outlying_run_warnings(findings.simulated["after"]["training"], findings.noise)
    return (messages or [findings.after.sentence]) + odd


def _unsearched(findings: Findings) -> list[str]:
    """Warnings on channels whose error exceeds the noise when no effect search was made."""
    return [
        f"the nominal model does not explain the {channel} of the {role} runs: the RMSE is "
        f"{entry['noise_ratio']:.3g} times the sensor noise (limit {NEAR_NOISE:.3g}), and its "
        "parameters are biased; run the effect search (fit without --no-effects)"
        for role, simulated in findings.simulated["after"].items()
        for channel, entry in (_errors(simulated, findings.noise) or {}).items()
        if (entry["noise_ratio"] or 0.0) > NEAR_NOISE
    ]


def _worse(findings: Findings) -> list[str]:
    """Warnings on validation runs that the nominal model predicts better."""
    if findings.outcome is None or not findings.outcome.effects:
        return []
    before, after = (findings.simulated[stage]["validation"] for stage in ("before", "after"))
    names = [found.name for found in findings.outcome.effects]
    return worse_warnings(before, after, findings.noise, names)


def _software() -> dict[str, str]:
    names = ("motorid", "casadi", "emcee", "numpy", "scipy")
    return {name: metadata.version(name) for name in names} | {"python": platform.python_version()}


def _options(findings: Findings) -> dict[str, object]:
    options = findings.options
    return {
        "seed": options.seed,
        "posterior": options.posterior,
        "effects": options.effects,
        "hold": options.hold,
        "temperatures": list(options.temperatures),
        "controllers": list(options.controllers),
        "effort": options.effort,
        "time_limit": options.time_limit,
        **({"known": list(options.known)} if options.known else {}),
        **({"nameplate": options.nameplate} if options.nameplate else {}),
    }


def _runs(campaign: Campaign) -> list[dict[str, object]]:
    hottest: dict[int, float] = {}
    for record in (*campaign.training, *campaign.validation):
        peak = float(record.column("temperature").max())
        hottest[record.run] = max(peak, hottest.get(record.run, peak))
    return [
        {
            "file": run.name,
            "sha256": run.sha256,
            "role": role,
            "rows": run.rows,
            "sample_rate_hz": run.sample_rate_hz,
            "hottest_degC": None if run.temperature is None else hottest.get(number),
            "same_as": campaign.alike[number],
        }
        for number, (role, run) in enumerate(
            [("training", run) for run in campaign.training_runs]
            + [("validation", run) for run in campaign.validation_runs]
        )
    ]


def _checks(admission: Admission | None, found: Sequence[Finding]) -> dict[str, object]:
    """Findings of the checks, whether the fit was forced, and the runs that were set aside."""
    if admission is None:
        return {"checks": [one.entry() for one in found], "forced": False, "set_aside": []}
    return {
        "checks": [one.entry() for one in (*admission.findings, *found)],
        "forced": admission.forced,
        "set_aside": [
            {"file": run.name, "sha256": run.sha256, "role": role}
            for run, role in admission.set_aside
        ],
    }


def _parameters(
    fit: Fit, draws: dict[str, Array], known: dict[str, bool], findings: Findings
) -> dict[str, dict[str, Any]]:
    priors = prior_entries(fit, findings.fraction, findings.options.priors, findings.contradicted)
    return {
        parameter.name: parameter_entry(
            draws[parameter.name], parameter.unit, known[parameter.name]
        )
        | {"estimate": _number(value)}
        | priors.get(parameter.name, {})
        for parameter, value in zip(fit.coordinates.parameters, fit.values, strict=True)
        if parameter.name in DECLARED_PARAMETERS
    }


def _errors(
    simulated: Sequence[Simulated], noise: Array
) -> dict[str, dict[str, float | None]] | None:
    if not simulated:
        return None
    entries: dict[str, dict[str, float | None]] = {}
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
            "rmse": _number(errors.rmse),
            "nrmse": _number(errors.nrmse),
            "noise_ratio": _number(ratio),
        }
    return entries


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _temperatures(findings: Findings) -> list[str]:
    """Warnings on runs without logged temperature: the estimate and its basis."""
    unseen = [one.record for one in findings.simulated["after"]["validation"]]
    found = estimated_temperatures(findings.final, unseen)
    if not found:
        return []
    estimates = ", ".join(
        f"{name} ({value:.1f} degC)" for name, value in [*found.items()][:_MOST_NAMED]
    )
    estimates += f" and {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
    training = findings.campaign.training_runs
    reference = "the other runs"
    if all(run.temperature is None for run in training):
        reference = f"{training[0].name}, which is assumed to be at "
        reference += f"{REFERENCE_TEMPERATURE_DEGC:g} degC, and the usual coefficient of a winding"
    messages = [
        f"the temperature was not logged in {estimates}: the temperature in brackets was "
        f"estimated from resistance and torque constant relative to {reference}"
    ]
    beyond = [name for name, value in found.items() if not COLDEST < value < HOTTEST]
    if beyond:
        messages.append(
            f"implausible winding temperature in {', '.join(beyond[:_MOST_NAMED])}: resistance and "
            f"torque constant require a value outside {COLDEST:g} to {HOTTEST:g} degC; check the "
            "gain of the current sensor and the leads of these runs, or log their temperature"
        )
    return messages


def _warnings(findings: Findings, missed: Sequence[str]) -> list[str]:
    """All warnings: validity of the result first, notes on the files last."""
    campaign, options = findings.campaign, findings.options
    runs = (*campaign.training_runs, *campaign.validation_runs)
    stopped = (options.effort, options.time_limit if findings.interrupted else None)
    return [
        *contradiction_warnings(findings.contradicted, runs),
        *(findings.admission.warnings if findings.admission else []),
        *missed,
        *_missing(findings),
        *_undetermined(findings),
        *findings.warnings,
        *early_ends(findings.final, findings.outcome, findings.sample, *stopped),
        *outlier_warnings(findings.simulated["after"]["training"]),
        *coarse_warnings(campaign.training_runs, findings.noise),
        *_worse(findings),
        *omitted_warnings(findings.final, findings.omitted),
        *confounded_warnings(findings.final, findings.fraction, findings.omitted),
        *known_only_warnings(findings.final, findings.fraction),
        *_temperatures(findings),
        *campaign.warnings,
        *(str(warning) for run in runs for warning in run.warnings),
    ]


def _undetermined(findings: Findings) -> list[str]:
    """Warning on the parameters that the runs do not determine."""
    # The linear part of a curve is reported under the parameter it is collinear with.
    lines = {line.name for line in linear_parts_of(findings.final)}
    lines |= {parameter.name for parameter in findings.final.simulator.model.unlogged.parameters}
    unknown = [name for name, found in findings.known.items() if not found and name not in lines]
    if not unknown:
        return []
    return [
        f"the runs do not determine {', '.join(unknown)}: the intervals are wide and come mainly "
        "from the general priors; the table of parameters in the report gives the reasons"
    ]
