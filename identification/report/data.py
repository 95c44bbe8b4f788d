"""What a report is drawn from: the result and the curves that are too long for it.

Plain arrays in frozen classes; nothing here computes.  What a campaign does not have is left at its
default, and the report leaves the part out or says why it is empty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Candidate",
    "CoefficientCurve",
    "Equation",
    "MissingTerm",
    "MissingTrace",
    "PosteriorChain",
    "ReportData",
    "RunTraces",
    "StepResponse",
    "Story",
]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RunTraces:
    """One run, measured and simulated.

    Args:
        name: File name as the user gave it.
        role: ``training`` or ``validation``.
        time: (n_sample,) increasing [s].
        voltage: (n_sample,) [V].
        temperature: (n_sample,) [degC], or None where not logged.
        measured_current: (n_sample,) [A]; NaN where the sample was not used.
        measured_speed: (n_sample,) [rad/s]; NaN where the sample was not used.
        after_current: (n_sample,) simulated by the final model [A].
        after_speed: (n_sample,) simulated by the final model [rad/s].
        before_current: (n_sample,) simulated by the declared model [A]; None where it is the final
            one.
        before_speed: (n_sample,) the same for the speed [rad/s].
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
    """The chain of the sampler after the burn-in.

    Args:
        names: (n_param,) as in the result.
        units: (n_param,).
        chain: (n_step, n_walker, n_param), each in its unit.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    chain: Array


@dataclass(frozen=True, eq=False)
class CoefficientCurve:
    """A coefficient of the motor over temperature, with its 90 % band.

    Args:
        name: ``Ra`` or ``Kt``.
        unit: Unit of the curves.
        temperature: (n_point,) increasing [degC].
        median: (n_point,).
        q05: (n_point,).
        q95: (n_point,).
        before: (n_point,) median of the declared model, where that is another.
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
        temperature_degC: Temperature of winding and magnet.
        controller: As the user gave it, such as ``PI:2,10``.
        time: (n_point,) increasing from zero [s].
        median: (n_point,) speed over reference [-].
        q05: (n_point,) [-].
        q95: (n_point,) [-].
        simulated: (n_point,) median with the effects in the loop [-]; None where none acts there.
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
    """What is missing in one equation, drawn against one driver, with the effect fitted to it.

    Args:
        equation: ``electrical`` or ``mechanical``.
        quantity: In words, such as ``missing torque``.
        unit: Unit of the quantity.
        driver: In words, such as ``speed``.
        driver_unit: Unit of the driver.
        driver_values: (n_sample,) where it was estimated.
        estimate: (n_sample,) smoothed missing term.
        grid: (n_point,) increasing values of the driver for the curve; empty where none was fitted.
        median: (n_point,) the fitted effect.
        q05: (n_point,).
        q95: (n_point,).
        effect: Name of the fitted effect; empty where none was fitted.
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
    """What is missing in one equation over the time of one run, with its 90 % band.

    Args:
        run: Name of the run.
        quantity: In words, such as ``missing torque``.
        unit: Unit of the quantity.
        time: (n_sample,) increasing [s].
        median: (n_sample,).
        q05: (n_sample,).
        q95: (n_sample,).
        fitted: (n_sample,) the fitted effect over the same time; empty where none was fitted.
        effect: Name of the fitted effect; empty where none was fitted.
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
class Candidate:
    """One effect that was tried.

    Args:
        name: As in the contract, or several joined by `` + ``.
        equation: Where it enters.
        explained: Share of the squared residual it explains on the training runs [-].
        held_out: Change of the squared error on runs left out, negative where it helps [-].
        probability: Posterior model probability [-].
        verdict: ``chosen``, ``alternative`` or ``ruled out``.
        reason: One sentence, why.
    """

    name: str
    equation: str
    explained: float | None
    held_out: float | None
    probability: float | None
    verdict: Literal["chosen", "alternative", "ruled out"]
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Story:
    """How a missing effect was found.

    Args:
        sentences: The finding in plain words, one paragraph each.
        terms: Missing torque or voltage against its drivers.
        traces: The same over time.
        candidates: What was tried, best first.
        remaining: What the final model still does not explain, in plain words.
    """

    sentences: tuple[str, ...] = ()
    terms: tuple[MissingTerm, ...] = ()
    traces: tuple[MissingTrace, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    remaining: tuple[str, ...] = ()


@dataclass(frozen=True)
class Equation:
    """One equation of the final model as text, and what it says in words."""

    text: str
    meaning: str = ""


@dataclass(frozen=True, eq=False)
class ReportData:
    """Everything a report shows.

    Args:
        result: Content of result.json.
        runs: Training runs, then validation runs.
        coefficients: Ra(T) and Kt(T).
        steps: Closed-loop step responses, each controller at each temperature.
        posterior: The chain; None where it was not sampled.
        story: How effects were found; None where no search was made.
        equations: The final model, printed from the expressions that were simulated.
        limits: More sentences on what the data cannot tell, beside the general ones.
        reasons: Why a parameter is not identified, one sentence by name.
        undrawn: What could not be drawn and why, one sentence each.
        title: Head of the report.
    """

    result: Mapping[str, Any]
    runs: tuple[RunTraces, ...]
    coefficients: tuple[CoefficientCurve, ...] = ()
    steps: tuple[StepResponse, ...] = ()
    posterior: PosteriorChain | None = None
    story: Story | None = None
    equations: tuple[Equation, ...] = ()
    limits: tuple[str, ...] = ()
    reasons: Mapping[str, str] = field(default_factory=dict)
    undrawn: tuple[str, ...] = ()
    title: str = "Motor identification"
