"""Findings of all identification stages: the input of the result and of the report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from identification.arrays import Array
from identification.checks.campaign import Admission
from identification.checks.finding import Finding
from identification.checks.plausible import heating_findings
from identification.diagnosis.detection import Detection, detect
from identification.diagnosis.localise import Localisation
from identification.diagnosis.outliers import noise_without_outlying_runs, root_mean_square
from identification.fit.campaign import Campaign
from identification.fit.evaluate import (
    Simulated,
    heating_effects,
    largest_heating,
    simulate_fitted,
    simulate_unseen,
)
from identification.fit.identifiability import identified
from identification.fit.knowledge import Comparison
from identification.fit.noise import noise_deviation
from identification.fit.sensors import bounded_noise
from identification.fit.solve import Fit
from identification.options import FitOptions
from identification.posterior.sample import Sample
from identification.result.entries import NEAR_NOISE
from identification.selection.omitted import OmittedTerm, consider_variances
from identification.selection.outcome import Outcome
from identification.speed_loop.controller import AbstractController
from identification.speed_loop.nonlinear import SimulatedLoop

__all__ = ["CHANNELS", "Findings"]

CHANNELS = ("current", "speed")
"""Logged channels that a model predicts, in the column order of every two-channel array."""

_GROSS = 1.5
"""Noise ratio above which autocorrelated noise cannot explain the error [-]."""


@dataclass(frozen=True)
class Findings:
    """Findings of the identification stages."""

    campaign: Campaign
    options: FitOptions
    declared: Fit
    """Fit of the nominal model (before)."""
    declared_draws: dict[str, Array]
    """Draws of its posterior, physical, by name."""
    final: Fit
    """Fit of the final model (after)."""
    fraction: float
    """Effective sample fraction in the final model."""
    draws: dict[str, Array]
    """Draws of the final model's posterior, physical, by name."""
    sample: Sample | None
    """The chain, None if none was requested."""
    feedback: list[dict[str, object]]
    """The feedback list of the result."""
    outcome: Outcome | None
    """Outcome of the effect search, None if none was made."""
    feedback_before: list[dict[str, object]]
    """The feedback list of the nominal model; empty if that is the final model."""
    suited: AbstractController | None
    """PI controller that suits the motor; None if the rule gives none."""
    loops: tuple[SimulatedLoop, ...]
    """Closed-loop simulations with the effects; empty if no effect acts in the loop."""
    localisation: Localisation | None
    """Missing voltage and torque of the nominal model, None if not estimated."""
    left: Localisation | None
    """Missing voltage and torque of the final model, None if not estimated."""
    interrupted: bool
    """Whether the time limit stopped a stage."""
    omitted: tuple[OmittedTerm, ...]
    """Terms that are not in the final model and could change its parameters."""
    admission: Admission
    """Findings of the input checks and the runs set aside."""
    contradicted: tuple[Comparison, ...]
    """Known values that the runs contradict."""

    @cached_property
    def simulated(self) -> dict[str, dict[str, list[Simulated]]]:
        """Simulations by ``before`` or ``after`` and by role of the runs."""
        return {
            stage: {
                "training": simulate_fitted(fit),
                "validation": simulate_unseen(
                    fit,
                    self.campaign.validation,
                    whole=any(term.tracked for term in fit.simulator.model.terms),
                ),
            }
            for stage, fit in (("before", self.declared), ("after", self.final))
        }

    @cached_property
    def before(self) -> Detection | None:
        """Residual tests of the nominal model; None without a search for effects."""
        return self._detected(self.declared, "before")

    @cached_property
    def after(self) -> Detection | None:
        """Residual tests of the final model; None without a search for effects."""
        return self._detected(self.final, "after")

    def _detected(self, fit: Fit, stage: str) -> Detection | None:
        if self.left is None:
            return None
        runs = self.simulated[stage]
        return detect(fit, runs["training"], runs["validation"], self.left.noise)

    @cached_property
    def known(self) -> dict[str, bool]:
        """Whether the data identify each parameter of the final model, omitted terms considered."""
        return identified(self.final, self.fraction, consider_variances(self.final, self.omitted))

    @cached_property
    def judged(self) -> Outcome | None:
        """Outcome with the probabilities of its effects given what the final model leaves."""
        if self.outcome is None:
            return None
        runs = self.simulated["after"]
        error = root_mean_square(runs["validation"] or runs["training"])
        judged = self.outcome.given(error / np.maximum(NEAR_NOISE * self.noise, 1e-300))
        return judged.doubting(heating_effects(self.final)) if self.overheating else judged

    @cached_property
    def overheating(self) -> list[Finding]:
        """Finding that the self-heating of the final model exceeds what a winding endures."""
        return heating_findings(largest_heating(self.final))

    @property
    def has_effects(self) -> bool:
        """Whether the final model contains effects."""
        return self.outcome is not None and bool(self.outcome.effects)

    @cached_property
    def noise(self) -> Array:
        """(2,) standard deviation of the noise of current and speed [A, rad/s].

        The base estimate is the RMS residual of the training runs.  If it is larger than
        autocorrelated noise can explain, the estimate with the missing voltage and torque removed
        replaces it, because unexplained structure is not noise.  A slightly larger residual still
        counts as noise, because slow sensor noise and a fluctuating voltage can look alike.  If the
        missing terms were not estimated, the base estimate is `noise_deviation` of the final fit.

        Outlying runs are excluded.  For a poorly simulated channel, the noise is bounded by the
        part of the channel that the other channels of the run cannot explain, so that a model that
        explains nothing cannot pass.
        """
        training = self.simulated["after"]["training"]
        error = root_mean_square(training)
        if self.after is None or self.left is None:
            found = noise_without_outlying_runs(training, noise_deviation(self.final))
            return bounded_noise(self.campaign.training, found, error)
        noise = error.copy()
        for k, channel in enumerate(CHANNELS):
            checks = self.after.of(channel, "training")
            if any(check.is_too_large and check.noise_ratio > _GROSS for check in checks):
                noise[k] = min(noise[k], self.left.noise[k])
        return bounded_noise(
            self.campaign.training, noise_without_outlying_runs(training, noise), error
        )
