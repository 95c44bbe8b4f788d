"""Extract of one result.json that the fleet table and the fleet page compare.

refit = refit_of("pump-17", "fitted", result)
refit.estimates["Ra25"].median
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from identification.quantities import DECLARED_PARAMETERS
from identification.result.entries import known_only_from

__all__ = [
    "Estimate",
    "Refit",
    "Size",
    "compared_with",
    "estimate_of",
    "refit_of",
    "searches_effects",
]

_NORMAL_90 = 1.645
_OF_SINGLE_RUNS = frozenset({"load_step", "inertia_change", "unlisted"})


@dataclass(frozen=True)
class Estimate:
    """Posterior summary of one parameter of one motor, with its 90 % interval, in its unit."""

    median: float | None
    sd: float | None
    q05: float | None
    q95: float | None
    is_identified: bool
    """True if the data identify it; a known value alone does not count."""

    @property
    def usable(self) -> tuple[float, float] | None:
        """Median and standard deviation; None if the data do not identify the parameter."""
        if not self.is_identified or self.median is None or self.sd is None:
            return None
        return self.median, self.sd

    @property
    def logarithm(self) -> tuple[float, float] | None:
        """Logarithm of the median and its standard deviation from the 90 % interval.

        None if the data do not identify the parameter or the median is not positive.
        """
        usable = self.usable
        if usable is None or usable[0] <= 0.0:
            return None
        if self.q05 is None or self.q95 is None or not 0.0 < self.q05 < self.q95:
            return math.log(usable[0]), usable[1] / usable[0]
        return math.log(usable[0]), math.log(self.q95 / self.q05) / (2.0 * _NORMAL_90)


@dataclass(frozen=True)
class Size:
    """Size of an effect: the first parameter of its entry in the result."""

    estimate: Estimate
    unit: str
    meaning: str
    """Its definition with the variant of the effect.  Two sizes are comparable only if their
    definitions are equal: the size of a drag refers to a speed, for example."""


@dataclass(frozen=True)
class Refit:
    """Result of one motor of a batch."""

    motor: str
    status: str
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    """Estimates of the nominal-model parameters in the final model, by name; empty without a
    result."""
    effects: tuple[str, ...] = ()
    """Names of the effects in the final model."""
    noise_ratios: Mapping[tuple[str, str], float | None] = field(default_factory=dict)
    """Simulation error of the final model over sensor noise [-], by role and channel, such as
    ``("validation", "speed")``."""
    training: tuple[str, ...] = ()
    """SHA-256 hashes of the training runs."""
    fit: str = ""
    """Id or location of the fit."""
    ended_at: str | None = None
    """End of the fit, UTC, ISO 8601."""
    error: str = ""
    warnings: tuple[str, ...] = ()
    previous: Refit | None = None
    link: str = ""
    """Address of its report relative to the page; empty if there is none."""
    type: str = ""
    """Type of the motor; motors without one are of one unnamed type."""
    sizes: Mapping[str, Size] = field(default_factory=dict)
    """Sizes of the effects that are properties of the motor or of the bench and not of single runs,
    by name such as ``"brush_drop.voltage"``."""
    equations: Mapping[str, str] = field(default_factory=dict)
    """Equation of each effect in the final model, by name."""
    is_searched: bool = True
    """True if the fit searched for effects.  Without it, the parameters stand for the effects as
    well, so they differ from those of a fit with it although the motor has not changed."""
    correlation: Mapping[tuple[str, str], float] = field(default_factory=dict)
    """Posterior correlation of two parameters or sizes; empty if unknown."""


def refit_of(motor: str, status: str, result: Mapping[str, Any]) -> Refit:
    """Extract the compared parts of a result; absent members count as unknown."""
    parameters = result.get("parameters") or {}
    after = (result.get("errors") or {}).get("after") or {}
    effects = result.get("effects") or ()
    return Refit(
        motor=motor,
        status=status,
        estimates={
            name: estimate_of(parameters[name])
            for name in DECLARED_PARAMETERS
            if name in parameters
        },
        effects=tuple(str(effect["name"]) for effect in effects),
        noise_ratios={
            (role, channel): ((after.get(role) or {}).get(channel) or {}).get("noise_ratio")
            for role in ("training", "validation")
            for channel in ("current", "speed")
        },
        training=tuple(
            str(run["sha256"])
            for run in result.get("runs") or ()
            if run.get("role") == "training" and run.get("sha256")
        ),
        warnings=tuple(str(warning) for warning in result.get("warnings") or ()),
        sizes=dict(
            _size(effect)
            for effect in effects
            if effect["name"] not in _OF_SINGLE_RUNS and effect.get("parameters")
        ),
        equations={str(effect["name"]): str(effect.get("equation", "")) for effect in effects},
        is_searched=searches_effects(result),
        correlation=_correlation(result.get("correlation") or {}),
    )


def searches_effects(result: Mapping[str, Any]) -> bool:
    """True if the fit of a result searched for effects."""
    return bool((result.get("options") or {}).get("effects", True))


def _correlation(entry: Mapping[str, Any]) -> dict[tuple[str, str], float]:
    """Known correlations of a result by pair of names."""
    names = entry.get("names") or ()
    return {
        (first, second): float(value)
        for first, row in zip(names, entry.get("matrix") or (), strict=False)
        for second, value in zip(names, row, strict=False)
        if value is not None
    }


def _size(effect: Mapping[str, Any]) -> tuple[str, Size]:
    name, entry = next(iter(effect["parameters"].items()))
    meaning = f"{entry.get('meaning', '')} {effect.get('variant') or ''}".strip()
    return f"{effect['name']}.{name}", Size(estimate_of(entry), entry.get("unit", ""), meaning)


def compared_with(refit: Refit, previous: Refit | None) -> Refit:
    """The refit with its previous refit, if both or neither of them searched for effects.

    Only one generation of history is kept.
    """
    if previous is None or previous.is_searched != refit.is_searched:
        return replace(refit, previous=None)
    return replace(refit, previous=replace(previous, previous=None))


def estimate_of(entry: Mapping[str, Any]) -> Estimate:
    """Summary of one parameter from its PARAMETER in a result; absent members are unknown."""
    return Estimate(
        median=entry.get("median"),
        sd=entry.get("sd"),
        q05=entry.get("q05"),
        q95=entry.get("q95"),
        # A parameter known only from its prior cannot drift and says nothing about this motor.
        is_identified=bool(entry.get("identified")) and not known_only_from(entry),
    )
