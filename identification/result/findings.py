"""Findings of all identification stages: the input of the result and of the report.

ResidualAnalysis holds the findings that need no posterior: tests of the residuals, sensor noise and
the probability of each effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from identification.arrays import Array
from identification.checks.campaign import Admission
from identification.checks.finding import Finding
from identification.checks.plausible import heating_findings
from identification.diagnosis.detection import Detection, detect
from identification.diagnosis.localise import Localisation
from identification.diagnosis.outliers import noise_without_outlying_runs, root_mean_square
from identification.diagnosis.residual import pooled_errors
from identification.effects.effect import effects_of
from identification.fit.campaign import Campaign
from identification.fit.evaluate import (
    Simulated,
    heating_effects,
    largest_heating,
    simulate_fitted,
    simulate_most_alike,
    simulate_unseen,
)
from identification.fit.identifiability import identified
from identification.fit.knowledge import Comparison
from identification.fit.noise import noise_deviation
from identification.fit.order_tracking import is_tracked
from identification.fit.sensors import bounded_noise
from identification.fit.solve import Fit
from identification.model.excitation import Record
from identification.options import FitOptions
from identification.posterior.sample import Sample
from identification.result.entries import NEAR_NOISE, NOTHING, finite_or_null
from identification.selection.omitted import OmittedTerm, consider_variances
from identification.selection.outcome import Outcome
from identification.speed_loop.controller import AbstractController
from identification.speed_loop.nonlinear import SimulatedLoop

__all__ = ["CHANNELS", "Errors", "Findings", "ResidualAnalysis", "channel_errors"]

CHANNELS = ("current", "speed")
"""Logged channels that a model predicts, in the column order of every two-channel array."""

Errors = dict[str, dict[str, float | None]]

_BEYOND_NOISE: Final = 2.0


@dataclass(frozen=True)
class ResidualAnalysis:
    """Residuals of both models, which need no posterior."""

    campaign: Campaign
    declared: Fit
    """Fit of the nominal model (before)."""
    final: Fit
    """Fit of the final model (after)."""
    outcome: Outcome | None
    """Outcome of the effect search, None if none was made."""
    left: Localisation | None
    """Missing voltage and torque of the final model, None if not estimated."""

    @cached_property
    def simulated(self) -> dict[str, dict[str, list[Simulated]]]:
        """Simulations by ``before`` or ``after`` and by role of the runs."""
        return {
            stage: {"training": simulate_fitted(fit), "validation": self._unseen(fit)}
            for stage, fit in (("before", self.declared), ("after", self.final))
        }

    def _unseen(self, fit: Fit) -> list[Simulated]:
        """Simulations of the validation runs.

        At unknown angles, sharp friction has local optima; the angles of the model with smooth
        friction are their start.  A load of each run that begins later than the run, such as a
        weight on a brake, is not in its first samples, so its size is fitted to the whole run.
        """
        records: Sequence[Record] = self.campaign.validation
        smooth = self.outcome.smooth if self.outcome and fit is self.final else None
        angles = is_tracked(fit.simulator.model)
        whole = angles or any(t.varies and t.moments for t in effects_of(fit.simulator.model.terms))
        if angles and smooth is not None:
            start = replace(fit, simulator=fit.simulator.changed_to(smooth, fit.values))
            records = [one.record for one in simulate_unseen(start, records, whole=True)]
        return simulate_most_alike(fit, records, whole=whole)

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
    def missed(self) -> Errors:
        """Training errors of the channels of which the final model explains nothing.

        Such an error may be sensor noise.  It is not if it exceeds the estimate of the noise, or if
        the errors of all channels are as large as the signals: with samples too far apart, every
        sample is unrelated to the one before.  The estimate itself may be as large as the signal,
        which no other channel explains; then the residual tests decide.
        """
        simulated = self.simulated["after"]["training"]
        signals, errors = np.zeros(2), np.zeros(2)
        for one in simulated:
            errors += np.sum(one.record.weight * one.residual**2, axis=0)
            signals += np.sum(one.record.weight * one.record.measured**2, axis=0)
        is_lost = errors > NOTHING**2 * signals
        is_all_lost = bool(is_lost[signals > 0.0].all())
        found = channel_errors(simulated, self.noise) or {}
        missed = {}
        for k, (channel, entry) in enumerate(found.items()):
            checks = self.after.of(channel, "training") if self.after else ()
            is_beyond = (entry["noise_ratio"] or 0.0) > _BEYOND_NOISE
            is_coloured = is_lost[k] and any(not check.passed for check in checks)
            if (entry["nrmse"] or 0.0) > NOTHING and (is_all_lost or is_beyond or is_coloured):
                missed[channel] = entry
        return missed

    @cached_property
    def judged(self) -> Outcome | None:
        """Outcome with the probabilities of its effects given what the final model leaves.

        A residual that may be noise is no discrepancy, also in validation runs with more noise.
        """
        if self.outcome is None:
            return None
        runs = self.simulated["after"]
        role = "validation" if runs["validation"] else "training"
        ratios = root_mean_square(runs[role]) / np.maximum(NEAR_NOISE * self.noise, 1e-300)
        is_noise = [self.after is not None and self.after.is_noise(c, role) for c in CHANNELS]
        judged = self.outcome.given(np.where(is_noise, np.minimum(ratios, 1.0), ratios))
        judged = judged.without_probabilities() if self.missed else judged
        return judged.doubting(heating_effects(self.final)) if self.overheating else judged

    @cached_property
    def overheating(self) -> list[Finding]:
        """Finding that the self-heating of the final model exceeds what a winding endures."""
        return heating_findings(largest_heating(self.final))

    @cached_property
    def noise(self) -> Array:
        """(2,) standard deviation of the noise of current and speed [A, rad/s].

        The base estimate is the RMS residual of the training runs.  If it is larger than noise can
        explain, also autocorrelated noise, the estimate with the missing voltage and torque removed
        replaces it, because unexplained structure is not noise.  If the missing terms were not
        estimated, the base estimate is `noise_deviation` of the final fit.

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
            if any(check.is_too_large for check in checks):
                noise[k] = min(noise[k], self.left.noise[k])
        return bounded_noise(
            self.campaign.training, noise_without_outlying_runs(training, noise), error
        )


def channel_errors(simulated: Sequence[Simulated], noise: Array) -> Errors | None:
    """Simulation errors by channel, with (2,) noise [A, rad/s]; None without runs."""
    if not simulated:
        return None
    entries: Errors = {}
    for channel, name in enumerate(CHANNELS):
        kept = [(s, s.record.weight[:, channel] > 0) for s in simulated]
        pairs = [(s, mask) for s, mask in kept if mask.any()]
        if not pairs:
            entries[name] = dict.fromkeys(("rmse", "nrmse", "noise_ratio"))
            continue
        errors = pooled_errors(
            [s.residual[mask, channel] for s, mask in pairs],
            [s.record.measured[mask, channel] for s, mask in pairs],
        )
        ratio = errors.rmse / noise[channel] if noise[channel] > 0 else np.nan
        found = {"rmse": errors.rmse, "nrmse": errors.nrmse, "noise_ratio": ratio}
        entries[name] = finite_or_null(found)
    return entries


@dataclass(frozen=True)
class Findings:
    """Findings of the identification stages."""

    analysis: ResidualAnalysis
    """Residuals of the nominal and the final model."""
    options: FitOptions
    declared_draws: dict[str, Array]
    """Draws of the nominal model's posterior, physical, by name."""
    fraction: float
    """Effective sample fraction in the final model."""
    draws: dict[str, Array]
    """Draws of the final model's posterior, physical, by name."""
    sample: Sample | None
    """The chain, None if none was requested."""
    feedback: list[dict[str, object]]
    feedback_before: list[dict[str, object]]
    """The feedback list of the nominal model; empty if that is the final model."""
    suited: AbstractController | None
    """PI controller that suits the motor; None if the rule gives none."""
    loops: tuple[SimulatedLoop, ...]
    """Closed-loop simulations with the effects; empty if no effect acts in the loop."""
    localisation: Localisation | None
    """Missing voltage and torque of the nominal model, None if not estimated."""
    interrupted: bool
    """True if the time limit stopped a stage."""
    omitted: tuple[OmittedTerm, ...]
    """Terms that are not in the final model and could change its parameters."""
    admission: Admission
    """Findings of the input checks and the runs set aside."""
    contradicted: tuple[Comparison, ...]
    """Known values that the runs contradict."""

    @cached_property
    def known(self) -> dict[str, bool]:
        """True if the data identify each parameter of the final model, omitted terms considered."""
        final = self.analysis.final
        return identified(final, self.fraction, consider_variances(final, self.omitted))

    @property
    def has_effects(self) -> bool:
        """True if the final model contains effects."""
        return self.analysis.outcome is not None and bool(self.analysis.outcome.effects)
