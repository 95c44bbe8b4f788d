"""Report data: the result, and the curves that are too long for it.

All classes are frozen and hold plain arrays; nothing is computed here.  Data that a campaign does
not have keep their default, and the report omits the section or says why it is empty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from identification.arrays import Array

__all__ = [
    "CandidateRow",
    "CoefficientCurve",
    "MissingTerm",
    "MissingTrace",
    "PosteriorChain",
    "ReportData",
    "RunTraces",
    "StepResponse",
    "SearchAccount",
]


@dataclass(frozen=True, eq=False)
class RunTraces:
    """Measured and simulated signals of one run.

    Args:
        name: File name as the user gave it.
        role: ``training`` or ``validation``.
        time: (n_sample,) increasing [s].
        voltage: (n_sample,) [V].
        temperature: (n_sample,) [degC], or None if not logged.
        measured_current: (n_sample,) [A]; NaN where the sample was not used.
        measured_speed: (n_sample,) [rad/s]; NaN where the sample was not used.
        after_current: (n_sample,) simulated by the final model [A].
        after_speed: (n_sample,) simulated by the final model [rad/s].
        before_current: (n_sample,) simulated by the nominal model [A]; None if that is the final
            model.
        before_speed: (n_sample,) simulated by the nominal model [rad/s]; None if that is the final
            model.
    """

    name: str
    role: Literal["training", "validation"]
    time: Array
    voltage: Array
    temperature: Array | None
    measured_current: Array
    measured_speed: Array
    after_current: Array
    after_speed: Array
    before_current: Array | None = None
    before_speed: Array | None = None


@dataclass(frozen=True, eq=False)
class PosteriorChain:
    """Chain of the sampler after burn-in.

    Args:
        names: (n_param,) names as in the result.
        units: (n_param,) their units.
        chain: (n_step, n_walker, n_param), each in its unit.
        least_length: Length required of a converged chain [autocorrelation times]; None if unknown.
        largest_r_hat: Largest split R-hat of a converged chain; None if unknown.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    chain: Array
    least_length: float | None = None
    largest_r_hat: float | None = None


@dataclass(frozen=True, eq=False)
class CoefficientCurve:
    """Coefficient of the motor over temperature, with its 90 % band.

    Args:
        name: ``Ra`` or ``Kt``.
        unit: Unit of the curves.
        temperature: (n_point,) increasing [degC].
        median: (n_point,) median.
        q05: (n_point,) lower end of the band.
        q95: (n_point,) upper end of the band.
        before: (n_point,) median of the nominal model; None if that is the final model.
    """

    name: str
    unit: str
    temperature: Array
    median: Array
    q05: Array
    q95: Array
    before: Array | None = None


@dataclass(frozen=True, eq=False)
class StepResponse:
    """Speed of the closed loop after a unit step of the reference, with its 90 % band.

    Args:
        temperature_degC: Temperature of winding and magnet [degC].
        controller: Controller as the user gave it, such as ``PI:2,10``.
        time: (n_point,) increasing from zero [s].
        median: (n_point,) speed over reference [-].
        q05: (n_point,) lower end of the band [-].
        q95: (n_point,) upper end of the band [-].
        simulated: (n_point,) median with the effects in the loop [-]; None if no effect acts there.
    """

    temperature_degC: float
    controller: str
    time: Array
    median: Array
    q05: Array
    q95: Array
    simulated: Array | None = None


@dataclass(frozen=True, eq=False)
class MissingTerm:
    """Missing voltage or torque against one driver, with the fitted effect.

    Args:
        equation: ``electrical`` or ``mechanical``.
        quantity: Label, such as ``missing torque``.
        unit: Unit of the quantity.
        driver: Label, such as ``speed``.
        driver_unit: Unit of the driver.
        driver_values: (n_sample,) driver values of the estimates.
        estimate: (n_sample,) smoothed missing term.
        grid: (n_point,) increasing driver values of the curve; empty if no effect was fitted.
        median: (n_point,) the fitted effect.
        q05: (n_point,) lower end of its 90 % band.
        q95: (n_point,) upper end of its 90 % band.
        effect: Name of the fitted effect; empty if none was fitted.
    """

    equation: str
    quantity: str
    unit: str
    driver: str
    driver_unit: str
    driver_values: Array
    estimate: Array
    grid: Array = field(default_factory=lambda: np.zeros(0))
    median: Array = field(default_factory=lambda: np.zeros(0))
    q05: Array = field(default_factory=lambda: np.zeros(0))
    q95: Array = field(default_factory=lambda: np.zeros(0))
    effect: str = ""


@dataclass(frozen=True, eq=False)
class MissingTrace:
    """Missing voltage or torque over the time of one run, with its 90 % band.

    Args:
        run: Name of the run.
        quantity: Label, such as ``missing torque``.
        unit: Unit of the quantity.
        time: (n_sample,) increasing [s].
        median: (n_sample,) smoothed missing term.
        q05: (n_sample,) lower end of the band.
        q95: (n_sample,) upper end of the band.
        fitted: (n_sample,) the fitted effects over the same time; empty if none was fitted.
        effect: Names of the fitted effects; empty if none was fitted.
    """

    run: str
    quantity: str
    unit: str
    time: Array
    median: Array
    q05: Array
    q95: Array
    fitted: Array = field(default_factory=lambda: np.zeros(0))
    effect: str = ""


@dataclass(frozen=True)
class CandidateRow:
    """CandidateRow effect of the search.

    Args:
        name: Name of the effect.
        equation: Equation that it enters.
        explained: Fraction of the squared residual that it explains on the training runs [-].
        validation: Relative change of the squared error on the validation runs [-].
        probability: Posterior model probability [-].
        verdict: ``chosen``, ``alternative`` or ``ruled out``.
        reason: Reason for the verdict, one sentence.
    """

    name: str
    equation: str
    explained: float | None
    validation: float | None
    probability: float | None
    verdict: Literal["chosen", "alternative", "ruled out"]
    reason: str = ""


@dataclass(frozen=True, eq=False)
class SearchAccount:
    """Account of the effect search for the report.

    Args:
        sentences: Findings in plain words, one paragraph each.
        terms: Missing torque or voltage against its drivers.
        traces: Missing torque or voltage over time.
        candidates: Candidates of the search, best first.
        remaining: What the final model does not explain, in plain words.
    """

    sentences: tuple[str, ...] = ()
    terms: tuple[MissingTerm, ...] = ()
    traces: tuple[MissingTrace, ...] = ()
    candidates: tuple[CandidateRow, ...] = ()
    remaining: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ReportData:
    """Everything that a report shows.

    Args:
        result: Content of result.json.
        runs: Training runs, then validation runs.
        coefficients: Ra(T) and Kt(T).
        steps: Closed-loop step responses, each controller at each temperature.
        posterior: The chain; None if not sampled.
        account: Account of the effect search; None if none was made.
        equations: The final model in MathML, printed from the simulated expressions.
        reasons: Why a parameter is not identified, one sentence by name.
        undrawn: What could not be drawn and why, one sentence each.
        confusions: What the runs cannot distinguish from the effects found, one text each.
        title: Title of the report.
        created: Date of the fit, such as ``2026-11-23``; empty if unknown.
    """

    result: Mapping[str, Any]
    runs: tuple[RunTraces, ...]
    coefficients: tuple[CoefficientCurve, ...] = ()
    steps: tuple[StepResponse, ...] = ()
    posterior: PosteriorChain | None = None
    account: SearchAccount | None = None
    equations: tuple[str, ...] = ()
    reasons: Mapping[str, str] = field(default_factory=dict)
    undrawn: tuple[str, ...] = ()
    confusions: tuple[str, ...] = ()
    title: str = "Motor identification"
    created: str = ""
