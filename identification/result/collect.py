"""Report data from the findings of all stages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

import numpy as np

from identification.arrays import Array
from identification.effects.catalogue import confusions_of
from identification.fit.evaluate import Simulated
from identification.ingest.run import Run
from identification.model.excitation import sample_interval
from identification.model.printing import printed_equations
from identification.posterior.convergence import LARGEST_R_HAT, REQUIRED_LENGTH
from identification.result.account import account_of
from identification.result.attempts import Attempts
from identification.result.diagnosis import signals_at
from identification.result.findings import Findings
from identification.result.missing_terms import missing_terms, missing_traces, unexplained_terms
from identification.result.partial_residuals import final_path
from identification.result.report_data import (
    CoefficientCurve,
    MissingTerm,
    MissingTrace,
    PosteriorChain,
    ReportData,
    RunTraces,
)
from identification.speed_loop import AbstractController, StepCurve, step_curves

__all__ = ["report_data"]

_POINTS: Final = 80


def report_data(result: dict[str, Any], findings: Findings, created: str = "") -> ReportData:
    """Collect the report data; a section that cannot be computed is omitted with a remark."""
    sample, analysis, attempts = findings.sample, findings.analysis, Attempts()
    final = analysis.final
    coefficients = attempts.rows("curve over temperature", _coefficients, findings)
    steps = attempts.rows("step response", _steps, findings)
    missing = attempts.part("missing term", _missing, result, findings) or ([], [])
    return ReportData(
        result=result,
        runs=tuple(_runs(findings)),
        coefficients=coefficients,
        steps=steps,
        posterior=None
        if sample is None
        else PosteriorChain(
            sample.names, sample.units, sample.chain, REQUIRED_LENGTH, LARGEST_R_HAT
        ),
        equations=tuple(printed_equations(final.simulator.model).values()),
        account=attempts.part(
            "search for effects", account_of, analysis.judged, result, final, *missing
        ),
        reasons=attempts.part("reason of a parameter", _reasons, findings) or {},
        undrawn=tuple(attempts.remarks),
        created=created,
        confusions=tuple(
            f"{confusion.title.capitalize()}. {confusion.apart}"
            for confusion in confusions_of([effect["name"] for effect in result["effects"]])
        ),
    )


def _steps(findings: Findings) -> list[StepCurve]:
    """Exact responses of the linear loop, and simulated responses if effects act in the loop."""
    simulated = {
        (loop.controller, loop.temperature_degC): (loop.time, np.median(loop.speed, axis=1))
        for loop in findings.loops
    }
    options, steps = findings.options, []
    suited = [findings.suited] if findings.suited else []
    controllers: list[str | AbstractController] = [*suited, *options.controllers]
    for curve in step_curves(findings.draws, options.temperatures, controllers):
        known = simulated.get((curve.controller, curve.temperature_degC))
        with_effects = None if known is None else np.interp(curve.time, *known)
        steps.append(replace(curve, simulated=with_effects))
    return steps


def _missing(
    result: dict[str, Any], findings: Findings
) -> tuple[list[MissingTerm], list[MissingTrace]]:
    """Plot data of the missing terms against their drivers, and over time."""
    terms: list[MissingTerm] = []
    traces: list[MissingTrace] = []
    final = findings.analysis.final
    if findings.has_effects:
        path = final_path(final, findings.draws, findings.localisation)
        terms = missing_terms(path)
        traces = missing_traces(path, [record.name for record in final.simulator.records])
    elif findings.localisation is not None:
        found = findings.localisation.missing
        signals = signals_at(findings.analysis.declared.simulator.records, found)
        terms = unexplained_terms(result["diagnosis"]["trace"], found, signals)
    return terms, traces


def _runs(findings: Findings) -> list[RunTraces]:
    traces = []
    analysis = findings.analysis
    campaign, simulated = analysis.campaign, analysis.simulated
    changed = analysis.final is not analysis.declared
    pairs = (("training", campaign.training_runs), ("validation", campaign.validation_runs))
    for role, runs in pairs:
        after = _by_run(simulated["after"][role], runs, lambda s: s.logged)
        before = _by_run(simulated["before"][role], runs, lambda s: s.logged)
        measured = _by_run(simulated["after"][role], runs, lambda s: s.record.measured)
        for run, a, b, m in zip(runs, after, before, measured, strict=True):
            current = run.used("current_A")
            traces.append(
                RunTraces(
                    name=run.name,
                    role=role,  # type: ignore[arg-type]
                    time=run.time,
                    voltage=run.voltage,
                    temperature=run.temperature,
                    # The record has the gain of the first run where the current sensor had another.
                    measured_current=np.where(np.isnan(current * m[:, 0]), current, m[:, 0]),
                    measured_speed=run.used("speed_rad_s"),
                    after_current=a[:, 0],
                    after_speed=a[:, 1],
                    before_current=b[:, 0] if changed else None,
                    before_speed=b[:, 1] if changed else None,
                )
            )
    return traces


def _by_run(
    simulated: list[Simulated], runs: tuple[Run, ...], channels: Callable[[Simulated], Array]
) -> list[Array]:
    """Channels of whole runs (n_sample, 2), NaN in the gaps between segments."""
    numbers = sorted({s.record.run for s in simulated})
    series = [np.full((run.rows, 2), np.nan) for run in runs]
    for s in simulated:
        at = numbers.index(s.record.run)
        series[at][s.record.start : s.record.start + s.record.rows] = channels(s)
    return series


def _coefficients(findings: Findings) -> list[CoefficientCurve]:
    logged = np.concatenate([r.column("temperature") for r in findings.analysis.campaign.training])
    wanted = findings.options.temperatures
    grid = np.linspace(min(logged.min(), *wanted), max(logged.max(), *wanted), _POINTS)
    changed = findings.analysis.final is not findings.analysis.declared
    curves = []
    for name, unit in (("Ra", "ohm"), ("Kt", "N m/A")):
        q05, median, q95 = _spread(name, findings.draws, grid)
        before = _spread(name, findings.declared_draws, grid)[1] if changed else None
        curves.append(CoefficientCurve(name, unit, grid, median, q05, q95, before))
    return curves


def _spread(name: str, draws: dict[str, Array], temperature: Array) -> Array:
    """(3, n_point) quantiles 5, 50 and 95 % of Ra or Kt at these temperatures [degC]."""
    slope = draws[f"alpha_{name}"][:, None]
    values = draws[f"{name}25"][:, None] * (1 + slope * (temperature - 25.0))
    return np.quantile(values, (0.05, 0.5, 0.95), axis=0)


def _reasons(findings: Findings) -> dict[str, str]:
    """Why a parameter is not identified, as far as the runs show it."""
    records = findings.analysis.campaign.training
    temperature = np.concatenate([r.column("temperature") for r in records])
    interval = sample_interval(records)
    values = findings.analysis.final.by_name
    reasons: dict[str, str] = {}
    if np.ptp(temperature) < 3.0:
        reasons["alpha_Ra"] = reasons["alpha_Kt"] = (
            f"the temperature span of the runs is {np.ptp(temperature):.1f} K; the coefficient "
            "requires runs at different temperatures"
        )
        if abs(float(np.mean(temperature)) - 25.0) > 5.0:
            reasons["Ra25"] = reasons["Kt25"] = (
                "all runs are at one temperature away from 25 degC, so the value at 25 degC "
                "depends on the general prior of the temperature coefficient"
            )
    if values["L"] / values["Ra25"] < 0.3 * interval:
        reasons["L"] = (
            "the electrical time constant is much shorter than the sample interval of "
            f"{1e3 * interval:.3g} ms"
        )
    return reasons
