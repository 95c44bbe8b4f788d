"""Assembly of result.json from the findings of all stages.

Every number of the result passes through this module once; the report and the command line print
the result and do not recompute it.
"""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import asdict, replace
from importlib import metadata
from typing import Any

import numpy as np

from identification.arrays import Array
from identification.checks.finding import Finding
from identification.checks.plausible import is_refuted, resistance_findings, time_constant_findings
from identification.diagnosis.outliers import outlier_warnings
from identification.effects.effect import effects_of
from identification.fit.campaign import Campaign
from identification.fit.identifiability import identified
from identification.fit.sensors import coarse_warnings
from identification.fit.solve import Fit
from identification.fit.temperature import estimated_temperatures
from identification.fit.voltage import coarse_voltage_warnings
from identification.model.unlogged import COLDEST, HOTTEST
from identification.posterior.sample import Sample
from identification.quantities import DECLARED_PARAMETERS, REFERENCE_TEMPERATURE_DEGC
from identification.result.diagnosis import detection_entry, shift_entries, trace_entry
from identification.result.early_stop import early_stop_warnings
from identification.result.entries import finite_or_null, parameter_entry
from identification.result.findings import Findings
from identification.result.known_values import (
    contradiction_warning,
    known_only_warnings,
    prior_entries,
)
from identification.result.models import effect_entries, model_entries, searched_entries
from identification.result.omitted import (
    confounded_entries,
    confounded_warnings,
    omitted_entries,
    omitted_warnings,
    sample_time_warnings,
    surrogate_warnings,
    undetermined_warnings,
)
from identification.result.simulation_errors import (
    error_entries,
    missed_channels,
    unexplained_channels,
    worse_runs,
)
from identification.selection.omitted import OmittedTerm, consider_variances
from identification.speed_loop import feedback_metrics
from identification.speed_loop.nonlinear import nonlinear_entry
from identification.warning import ResultWarning

__all__ = ["assemble", "doubtful_parameters"]

_CORRELATION_DIGITS = 6
_DOUBTFUL = {"resistance_coefficient": ("Ra25", "alpha_Ra", "L")}
"""Parameters that an implausible value makes doubtful, however well the runs determine it."""
_DOUBTFUL_IF_INCOMPLETE = {"electrical_time_constant": ("L", "Ra25", "J", "b")}
"""The same, if the residual also misses terms: L may hold the lag of a sensor, and the others make
up for what a large L does to the speed."""
_MOST_NAMED = 12
"""Largest number of runs that a warning on temperatures names."""


def assemble(findings: Findings) -> dict[str, object]:
    """Content of result.json, schema version 1."""
    analysis = findings.analysis
    final, declared = analysis.final, analysis.declared
    records = declared.simulator.records
    known = identified(declared, findings.fraction)
    before = _parameters(declared, findings.declared_draws, known, findings)
    after = _parameters(final, findings.draws, findings.known, findings)
    findings, implausible = _reconsidered(findings)
    missed = missed_channels(analysis)
    doubtful = doubtful_parameters(implausible, findings.omitted)
    for name in after if missed else doubtful:
        after[name] = after[name] | {"identified": False}
    warnings = _warnings(findings, [*missed, *(one.warning() for one in implausible)])
    return {
        "schema_version": 1,
        "software": _software(),
        "options": _options(findings),
        "runs": _runs(analysis.campaign),
        "checks": [one.entry() for one in (*findings.admission.findings, *implausible)],
        "forced": findings.admission.forced,
        "set_aside": [
            {"file": run.name, "sha256": run.sha256, "role": role}
            for run, role in findings.admission.set_aside
        ],
        "declared": {
            "hold": declared.simulator.model.hold,
            "voltage": analysis.campaign.voltage,
            "parameters": before,
        },
        "parameters": after,
        "correlation": _correlation(final, findings.draws),
        "effects": _effects(findings, is_missed=bool(missed)),
        "models": model_entries(analysis.outcome, final, findings.fraction),
        "diagnosis": {
            "residual": detection_entry(analysis.before),
            "trace": trace_entry(findings.localisation, analysis.outcome, records),
            "searched": searched_entries(analysis.outcome),
            "omitted": omitted_entries(final, findings.omitted),
            "confounded": confounded_entries(final, findings.omitted),
            "remaining": detection_entry(analysis.after)
            | trace_entry(analysis.left, None, records),
            "shifts": shift_entries(after, before, findings.draws, findings.declared_draws)
            if findings.has_effects
            else {},
        },
        "errors": error_entries(analysis),
        "noise": {
            "current_A": finite_or_null(analysis.noise[0]),
            "speed_rad_s": finite_or_null(analysis.noise[1]),
        },
        "feedback": findings.feedback,
        "feedback_before": findings.feedback_before,
        "feedback_nonlinear": [nonlinear_entry(loop) for loop in findings.loops],
        "feedback_suited": _suited(findings),
        "sampler": _sampler(findings.sample),
        "warnings": [str(warning) for warning in warnings],
        "warning_details": [warning.details() for warning in warnings],
    }


def doubtful_parameters(implausible: Sequence[Finding], omitted: Sequence[OmittedTerm]) -> set[str]:
    """Parameters that implausible values of the fit make doubtful; `omitted` are missed terms."""
    doubtful: dict[str, tuple[str, ...]] = {**_DOUBTFUL}
    if any(not t.parameter and t.surrogate is None and t.gain is not None for t in omitted):
        doubtful |= _DOUBTFUL_IF_INCOMPLETE
    return {name for one in implausible for name in doubtful.get(one.code, ())}


def _effects(findings: Findings, *, is_missed: bool) -> list[dict[str, Any]]:
    """Entries of the effects; `is_missed` says that the model explains nothing of a channel."""
    analysis = findings.analysis
    known = dict.fromkeys(findings.known, False) if is_missed else findings.known
    return effect_entries(analysis.judged, analysis.final, findings.draws, known, findings.fraction)


def _correlation(final: Fit, draws: dict[str, Array]) -> dict[str, object]:
    """Member ``correlation`` of the result: the parameters of the nominal model and of the effects.

    A parameter whose draws are equal has no correlation; null stands for it.
    """
    prefixes = tuple(f"{effect.name}." for effect in effects_of(final.simulator.model.terms))
    names = [
        name
        for name in final.coordinates.names
        if name in DECLARED_PARAMETERS or name.startswith(prefixes)
    ]
    with np.errstate(invalid="ignore", divide="ignore"):
        matrix = np.atleast_2d(np.corrcoef([draws[name] for name in names]))
    return {"names": names, "matrix": finite_or_null(matrix.round(_CORRELATION_DIGITS))}


def _suited(findings: Findings) -> list[dict[str, Any]]:
    if findings.suited is None:
        return []
    return feedback_metrics(findings.draws, findings.options.temperatures, [findings.suited])


def _sampler(sample: Sample | None) -> dict[str, object] | None:
    if sample is None:
        return None
    convergence = asdict(sample.convergence)
    is_converged = convergence.pop("reached")
    return {
        **convergence,
        "converged": is_converged,
        "draws": sample.source,
        "pareto_k": None if sample.shape is None else finite_or_null(sample.shape),
    }


def _reconsidered(findings: Findings) -> tuple[Findings, list[Finding]]:
    """Findings without a suspicion that the fit refutes, and implausible values of the fit.

    Only values that the runs determine and the user has not given are considered.
    Effects confounded with a single parameter do not widen its uncertainty here: an inductance is
    reported as implausible even if a sensor lag may explain it.
    """
    final = findings.analysis.final
    others = [term for term in findings.omitted if not term.parameter]
    known = identified(final, findings.fraction, consider_variances(final, others))
    given = {p.name for p in final.coordinates.parameters if p.origin} - {"Ra25", "Kt25"}
    values = final.by_name
    deviations = dict(zip(final.coordinates.names, map(float, final.deviations), strict=True))
    trusted = {name: known[name] and name not in given for name in DECLARED_PARAMETERS}
    kept = [
        one
        for one in findings.admission.findings
        if not is_refuted(one, values, deviations, trusted)
    ]
    if len(kept) < len(findings.admission.findings):
        # A copy would simulate all runs again.
        admission = replace(findings.admission, findings=tuple(kept))
        findings = replace(findings, admission=admission)
    return findings, [
        *time_constant_findings(values, trusted),
        *resistance_findings(values, deviations, trusted),
        *findings.analysis.overheating,
    ]


def _software() -> dict[str, str]:
    names = ("motorid", "casadi", "emcee", "numpy", "scipy")
    return {name: metadata.version(name) for name in names} | {"python": platform.python_version()}


def _options(findings: Findings) -> dict[str, object]:
    # `checks` and `set_aside` of the result say what became of contradictory runs.
    options = asdict(replace(findings.options, set_aside=False, force=False))
    left_out = {name for name in ("set_aside", "force", "known", "nameplate") if not options[name]}
    return {name: finite_or_null(v) for name, v in options.items() if name not in left_out}


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
            # In SI units, of all logged channels but the angle.
            "ranges": {
                name: [float(values.min()), float(values.max())]
                for name, values in run.channels.items()
                if name != "position_rad"
            },
            "same_as": campaign.alike[number],
            "channels": {name: source.entry() for name, source in run.sources.items()},
        }
        for number, (role, run) in enumerate(
            [("training", run) for run in campaign.training_runs]
            + [("validation", run) for run in campaign.validation_runs]
        )
    ]


def _parameters(
    fit: Fit, draws: dict[str, Array], known: dict[str, bool], findings: Findings
) -> dict[str, dict[str, Any]]:
    priors = prior_entries(fit, findings.fraction, findings.options.priors, findings.contradicted)
    return {
        parameter.name: parameter_entry(
            draws[parameter.name], parameter.unit, known[parameter.name]
        )
        | {"estimate": finite_or_null(value)}
        | priors.get(parameter.name, {})
        for parameter, value in zip(fit.coordinates.parameters, fit.values, strict=True)
        if parameter.name in DECLARED_PARAMETERS
    }


def _temperatures(findings: Findings) -> list[ResultWarning]:
    """Warnings on runs without logged temperature: the estimate and its basis."""
    unseen = [one.record for one in findings.analysis.simulated["after"]["validation"]]
    found = estimated_temperatures(findings.analysis.final, unseen)
    if not found:
        return []
    estimates = ", ".join(
        f"{name} ({value:.1f} degC)" for name, value in [*found.items()][:_MOST_NAMED]
    )
    estimates += f" and {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
    training = findings.analysis.campaign.training_runs
    reference = "the other runs"
    if all(run.temperature is None for run in training):
        reference = f"{training[0].name}, which is assumed to be at "
        reference += f"{REFERENCE_TEMPERATURE_DEGC:g} degC, and the usual coefficient of a winding"
    message = (
        f"the temperature was not logged in {estimates}: the temperature in brackets was "
        f"estimated from resistance and torque constant relative to {reference}"
    )
    warnings = [ResultWarning("estimated_temperature", "note", message)]
    beyond = [name for name, value in found.items() if not COLDEST < value < HOTTEST]
    if beyond:
        message = (
            f"implausible winding temperature in {', '.join(beyond[:_MOST_NAMED])}: resistance and "
            f"torque constant require a value outside {COLDEST:g} to {HOTTEST:g} degC"
        )
        fix = (
            "check the gain of the current sensor and the leads of these runs, or log their "
            "temperature"
        )
        warnings.append(ResultWarning("implausible_temperature", "warning", message, fix))
    return warnings


def _warnings(findings: Findings, missed: Sequence[ResultWarning]) -> list[ResultWarning]:
    """All warnings: validity of the result first, notes on the files last."""
    analysis, options = findings.analysis, findings.options
    campaign, final = analysis.campaign, analysis.final
    runs = (*campaign.training_runs, *campaign.validation_runs)
    stopped = (options.effort, options.time_limit if findings.interrupted else None)
    temperatures = _temperatures(findings)
    # An estimate tells more than the note of its file that there is no temperature.
    covered = {"no_temperature"} if temperatures else set()
    notes = [w for run in runs for w in run.warnings if w.code not in covered]
    undetermined = undetermined_warnings(final, findings.known)
    return [
        *(contradiction_warning(one, runs[0]) for one in findings.contradicted),
        *findings.admission.warnings,
        *sample_time_warnings(final, findings.fraction, findings.omitted),
        *missed,
        *unexplained_channels(analysis),
        *undetermined,
        *early_stop_warnings(
            final, analysis.outcome, findings.sample, *stopped, is_determined=not undetermined
        ),
        *outlier_warnings(analysis.simulated["after"]["training"]),
        *coarse_warnings(campaign.training_runs, analysis.noise),
        *coarse_voltage_warnings(campaign.training_runs, final),
        *worse_runs(analysis),
        *omitted_warnings(final, findings.omitted),
        *([] if missed else surrogate_warnings(final, findings.omitted)),
        *confounded_warnings(final, findings.fraction, findings.omitted),
        *known_only_warnings(final, findings.fraction),
        *temperatures,
        *campaign.warnings,
        *(ResultWarning(note.code, "note", str(note)) for note in notes),
    ]
