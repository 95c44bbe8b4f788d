"""What the stages of an identification found: all that the result and the report are made from."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from identification.checks.admission import Admission
from identification.diagnosis.detection import Detection
from identification.diagnosis.localise import Localisation
from identification.diagnosis.odd_runs import noise_of_most, root_mean_square
from identification.effects.omitted import OmittedTerm, consider_variances
from identification.effects.outcome import Outcome
from identification.feedback.nonlinear import SimulatedLoop
from identification.fit.campaign import Campaign
from identification.fit.ceiling import bounded_noise
from identification.fit.evaluate import Simulated, simulate_fitted, simulate_unseen
from identification.fit.identifiability import identified
from identification.fit.knowledge import Comparison
from identification.fit.noise import noise_deviation
from identification.fit.solve import Fit
from identification.options import FitOptions
from identification.posterior.sample import Sample

__all__ = ["CHANNELS", "Findings"]

Array = NDArray[np.float64]

CHANNELS = ("current", "speed")
"""The logged channels that a model predicts, in the order of every array that has both."""

_GROSS = 1.5
"""Error over the noise above which no colour of the noise explains it."""


@dataclass(frozen=True)
class Findings:
    """What the stages found.

    Args:
        campaign: Runs and records.
        options: What the user chose.
        declared: Fit of the declared model (before).
        declared_draws: Draws of its posterior, physical, by name.
        final: Fit of the final model (after).
        share: Effective share of the samples in the final model.
        draws: Draws of the final model's posterior, physical, by name.
        sample: The chain, None where none was asked for.
        feedback: The feedback list of the result.
        outcome: What the search for effects found, None where none was made.
        feedback_before: The feedback list of the declared model; empty where it is the final one.
        loops: The loop simulated with the effects in it; empty where none acts there.
        localisation: The missing voltage and torque beside the declared model, None where they
            were not looked for.
        left: The same beside the final model.
        before: Whether the declared model leaves something, None where it was not looked for.
        after: Whether the final model does.
        interrupted: Whether the time limit stopped a stage.
        warnings: What the stages noticed.
        omitted: What is not in the final model and could change its parameters.
        admission: What the checks found in the runs given, None where they were not checked.
        contradicted: Known values that the runs contradict.
    """

    campaign: Campaign
    options: FitOptions
    declared: Fit
    declared_draws: dict[str, Array]
    final: Fit
    share: float
    draws: dict[str, Array]
    sample: Sample | None
    feedback: list[dict[str, object]]
    outcome: Outcome | None = None
    feedback_before: list[dict[str, object]] = field(default_factory=list)
    loops: tuple[SimulatedLoop, ...] = ()
    localisation: Localisation | None = None
    left: Localisation | None = None
    before: Detection | None = None
    after: Detection | None = None
    interrupted: bool = False
    warnings: tuple[str, ...] = field(default=())
    omitted: tuple[OmittedTerm, ...] = ()
    admission: Admission | None = None
    contradicted: tuple[Comparison, ...] = ()

    @cached_property
    def simulated(self) -> dict[str, dict[str, list[Simulated]]]:
        """Simulations by ``before`` or ``after`` and by role of the runs."""
        return {
            stage: {
                "training": simulate_fitted(fit),
                "validation": simulate_unseen(fit, self.campaign.validation),
            }
            for stage, fit in (("before", self.declared), ("after", self.final))
        }

    @cached_property
    def known(self) -> dict[str, bool]:
        """Whether the data determine each parameter of the final model, whatever it lacks."""
        return identified(self.final, self.share, consider_variances(self.final, self.omitted))

    @property
    def has_effects(self) -> bool:
        """Whether the final model is another than the declared one."""
        return self.outcome is not None and bool(self.outcome.effects)

    @cached_property
    def noise(self) -> Array:
        """(2,) standard deviation of the noise of current and speed [A, rad/s].

        Where the residual of the training runs is far larger than noise can be, it is the noise
        with the missing voltage and torque taken out: what the model lacks is no noise.  Nor is
        what only runs have that do not fit the others.  Where it is little larger, slow noise of a
        sensor and a voltage that wanders may look alike.  It is never more than what the other
        channels of a run leave unexplained, so that a model that explains nothing cannot pass.
        """
        training = self.simulated["after"]["training"]
        error = root_mean_square(training)
        if self.after is None or self.left is None:
            found = noise_of_most(training, noise_deviation(self.final))
            return bounded_noise(self.campaign.training, found, error)
        noise = error.copy()
        for k, channel in enumerate(CHANNELS):
            checks = self.after.of(channel, "training")
            if any(check.is_too_large and check.noise_ratio > _GROSS for check in checks):
                noise[k] = min(noise[k], self.left.noise[k])
        return bounded_noise(self.campaign.training, noise_of_most(training, noise), error)
