"""Report data: the result, and the curves that are too long for it.

All classes are frozen and hold plain arrays; nothing is computed here.  Data that a campaign does
not have keep their default, and the report omits the section or says why it is empty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from identification.arrays import Array

if TYPE_CHECKING:
    # Loading the closed loop would delay the first page of a result.
    from identification.speed_loop import StepCurve as StepCurve

__all__ = [
    "CandidateRow",
    "CoefficientCurve",
    "MissingTerm",
    "MissingTrace",
    "PosteriorChain",
    "ReportData",
    "RunTraces",
    "SearchAccount",
]


@dataclass(frozen=True, eq=False)
class RunTraces:
    """Signals of one run, (n_sample,) each: time [s], V, degC, A and rad/s.

    Measured signals are NaN where the sample was not used.  Those simulated by the final model are
    `after`, those by the nominal model `before`, None if that is the final model.
    """

    name: str
    """File name as the user gave it."""
    role: Literal["training", "validation"]
    time: Array
    voltage: Array
    temperature: Array | None
    """None if not logged."""
    measured_current: Array
    measured_speed: Array
    after_current: Array
    after_speed: Array
    before_current: Array | None = None
    before_speed: Array | None = None


@dataclass(frozen=True, eq=False)
class PosteriorChain:
    """Chain of the sampler after burn-in."""

    names: tuple[str, ...]
    """(n_param,) names as in the result."""
    units: tuple[str, ...]
    """(n_param,) their units."""
    chain: Array
    """(n_step, n_walker, n_param), each in its unit."""
    least_length: float
    """Length required of a converged chain [autocorrelation times]."""
    largest_r_hat: float
    """Largest split R-hat of a converged chain."""


@dataclass(frozen=True, eq=False)
class CoefficientCurve:
    """Coefficient of the motor over temperature, with its 90 % band; arrays are (n_point,)."""

    name: str
    """``Ra`` or ``Kt``."""
    unit: str
    temperature: Array
    """Increasing [degC]."""
    median: Array
    q05: Array
    q95: Array
    before: Array | None = None
    """Median of the nominal model; None if that is the final model."""


@dataclass(frozen=True, eq=False)
class MissingTerm:
    """Missing voltage or torque against one driver, with the fitted effect."""

    equation: str
    """``electrical`` or ``mechanical``."""
    quantity: str
    """Label, such as ``missing torque``."""
    unit: str
    driver: str
    """Label, such as ``speed``."""
    driver_unit: str
    driver_values: Array
    """(n_sample,) driver values of the estimates."""
    estimate: Array
    """(n_sample,) smoothed missing term."""
    grid: Array = field(default_factory=lambda: np.zeros(0))
    """(n_point,) increasing driver values of the curve; empty if no effect was fitted."""
    median: Array = field(default_factory=lambda: np.zeros(0))
    """(n_point,) the fitted effect; `q05` and `q95` are the ends of its 90 % band."""
    q05: Array = field(default_factory=lambda: np.zeros(0))
    q95: Array = field(default_factory=lambda: np.zeros(0))
    effect: str = ""
    """Name of the fitted effect; empty if none was fitted."""


@dataclass(frozen=True, eq=False)
class MissingTrace:
    """Missing voltage or torque over the time of one run, with its 90 % band, (n_sample,) each."""

    run: str
    quantity: str
    """Label, such as ``missing torque``."""
    unit: str
    time: Array
    """Increasing [s]."""
    median: Array
    """Smoothed missing term."""
    q05: Array
    q95: Array
    fitted: Array = field(default_factory=lambda: np.zeros(0))
    """The fitted effects; empty if none was fitted."""
    effect: str = ""
    """Names of the fitted effects; empty if none was fitted."""


@dataclass(frozen=True)
class CandidateRow:
    """Candidate effect of the search."""

    name: str
    equation: str
    explained: float | None
    """Fraction of the squared residual that it explains on the training runs [-]."""
    validation: float | None
    """Relative change of the squared error on the validation runs [-]."""
    probability: float | None
    """Posterior model probability [-]."""
    verdict: Literal["chosen", "alternative", "ruled out"]
    reason: str = ""
    """Reason for the verdict, one sentence."""


@dataclass(frozen=True, eq=False)
class SearchAccount:
    """Account of the effect search for the report."""

    sentences: tuple[str, ...] = ()
    """Findings in plain words, one paragraph each."""
    terms: tuple[MissingTerm, ...] = ()
    traces: tuple[MissingTrace, ...] = ()
    candidates: tuple[CandidateRow, ...] = ()
    """Candidates of the search, best first."""
    remaining: tuple[str, ...] = ()
    """What the final model does not explain, in plain words."""


@dataclass(frozen=True, eq=False)
class ReportData:
    """Everything that a report shows."""

    result: Mapping[str, Any]
    runs: tuple[RunTraces, ...]
    """Training runs, then validation runs."""
    coefficients: tuple[CoefficientCurve, ...] = ()
    """Ra(T) and Kt(T)."""
    steps: tuple[StepCurve, ...] = ()
    """Closed-loop step responses, each controller at each temperature."""
    posterior: PosteriorChain | None = None
    """The chain; None if not sampled."""
    account: SearchAccount | None = None
    """Account of the effect search; None if none was made."""
    equations: tuple[str, ...] = ()
    """The final model in MathML, printed from the simulated expressions."""
    reasons: Mapping[str, str] = field(default_factory=dict)
    """Why a parameter is not identified, one sentence by name."""
    undrawn: tuple[str, ...] = ()
    """What could not be drawn and why, one sentence each."""
    confusions: tuple[str, ...] = ()
    """What the runs cannot distinguish from the effects found, one text each."""
    title: str = "Motor identification"
    created: str = ""
    """Date of the fit, such as ``2026-11-23``; empty if unknown."""
