"""Findings of all identification stages: the input of the result and of the report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from identification.arrays import Array
from identification.checks.campaign import Admission
from identification.diagnosis.localise import Localisation
from identification.fit.identifiability import identified
from identification.fit.knowledge import Comparison
from identification.options import FitOptions
from identification.posterior.sample import Sample
from identification.result.residual_analysis import ResidualAnalysis
from identification.selection.omitted import OmittedTerm, consider_variances
from identification.speed_loop.controller import AbstractController
from identification.speed_loop.nonlinear import SimulatedLoop

__all__ = ["Findings"]


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
    """Whether the time limit stopped a stage."""
    omitted: tuple[OmittedTerm, ...]
    """Terms that are not in the final model and could change its parameters."""
    admission: Admission
    """Findings of the input checks and the runs set aside."""
    contradicted: tuple[Comparison, ...]
    """Known values that the runs contradict."""

    @cached_property
    def known(self) -> dict[str, bool]:
        """Whether the data identify each parameter of the final model, omitted terms considered."""
        final = self.analysis.final
        return identified(final, self.fraction, consider_variances(final, self.omitted))

    @property
    def has_effects(self) -> bool:
        """Whether the final model contains effects."""
        return self.analysis.outcome is not None and bool(self.analysis.outcome.effects)
