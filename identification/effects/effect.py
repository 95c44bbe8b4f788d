"""Candidate terms of the search, with their starting values and the scales of a campaign.

An effect is a term (`model.term`) with one more method: `candidates` returns prototypes of the
term for the motor at hand.  A prototype is the term at starting values of finite size.  The score
test uses prototypes instead of the derivative at zero, because the derivative of a filter or lag
vanishes there and the derivative of friction near standstill does not have the effect's shape.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.model.excitation import Record
from identification.model.parameter import Parameter
from identification.model.term import AbstractDelay, AbstractHold, AbstractMean, AbstractTerm

__all__ = [
    "AbstractForced",
    "Candidate",
    "CampaignScales",
    "amplitude",
    "asymmetry",
    "columns",
    "shape",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CampaignScales:
    """Scales of one campaign, from its signals and a fit.

    Args:
        records: Training records.
        current: Root mean square of the current [A].
        speed: Root mean square of the speed [rad/s].
        voltage: Root mean square of the voltage [V].
        torque: Kt25 times `current` [N m].
        interval: Median sample interval [s].
        duration: Duration of the longest record [s].
        speed_noise: Standard deviation of the speed residual [rad/s].
        current_noise: Standard deviation of the current residual [A].
        values: (7,) physical values of the nominal parameters in the fit.
        angle_logged: Whether the shaft angle is logged; if not, it is integrated from the speed.
        orders: Prominent orders of the residual, in periods per revolution [-].
    """

    records: tuple[Record, ...]
    current: float
    speed: float
    voltage: float
    torque: float
    interval: float
    duration: float
    current_noise: float
    speed_noise: float
    values: Array
    angle_logged: bool
    orders: tuple[float, ...] = ()

    @property
    def runs(self) -> tuple[int, ...]:
        """Numbers of the training runs, ascending."""
        return tuple(sorted({record.run for record in self.records}))

    @property
    def knows_temperatures(self) -> bool:
        """Whether the temperature was logged in every training run."""
        return all(record.expected is None for record in self.records)

    @property
    def heated(self) -> float:
        """Range of the logged temperature over all training runs [K]."""
        columns = [record.column("temperature") for record in self.records]
        return float(max(c.max() for c in columns) - min(c.min() for c in columns))


@dataclass(frozen=True)
class Candidate:
    """A term to try, with the values from which its score and its refit start.

    Args:
        term: The term that is scored, its fields set for this motor.
        starts: (n_parameter, n_start) physical values, each of finite size.
        joint: Number of consecutive starts that are linear amplitudes and are scored together.
        fitted: The term that is refitted, if it differs from `term`: its parameters are the first
            ones of `term`, and the others become states, free in each record.  Such starts are
            scored with per-record amplitudes.
        by_run: Whether the term acts in one run only, given by its field `run`.  It is simulated
            in all runs at once, with `run` None, and scored for each run.
        recurs: Whether such a term may act alike in several runs, given by its field `others`.
        tried: (n_parameter, n_point) additional starting points of the refit, for terms whose
            score does not show how good a starting point is.
        traded: Additional starting points of the refit, each with factors on parameters that are
            already in the model: these parameters give back the effect that they had absorbed.
    """

    term: AbstractTerm
    starts: Array
    joint: int = 1
    fitted: AbstractTerm | None = None
    by_run: bool = False
    recurs: bool = False
    tried: Array | None = None
    traded: tuple[tuple[Array, dict[str, float]], ...] = ()

    @property
    def lanes(self) -> int:
        """Number of simulations side by side: the number of starts, at least one."""
        return max(int(self.starts.shape[1]), 1)

    @property
    def prototypes(self) -> int:
        """Number of separately scored prototypes; one scored in several runs counts once."""
        return max(self.lanes // self.joint, 1)

    @property
    def can_rest(self) -> bool:
        """Whether the term has neutral values, at which it leaves the model unchanged."""
        if self.term.states or isinstance(self.term, AbstractDelay | AbstractHold | AbstractMean):
            return False
        return any(parameter.vanishes for parameter in self.term.parameters)

    @property
    def resting(self) -> Array:
        """(n_parameter,) neutral values, if the term has any."""
        first = self.starts.reshape(-1, self.lanes)[:, 0].copy()
        for row, parameter in enumerate(self.term.parameters):
            if parameter.vanishes:
                first[row] = 0.0
        return first

    def in_runs(self, run: int, *others: int) -> Candidate:
        """The candidate restricted to one run, or to `run` and `others` if it recurs."""
        term: Any = self.term
        own = {"run": run} | ({"others": others} if others else {})
        return replace(self, term=replace(term, **own), by_run=False, recurs=False)

    @property
    def final(self) -> AbstractTerm:
        """The term that a refit uses."""
        return self.fitted or self.term

    @property
    def by_record(self) -> bool:
        """Whether the amplitudes are free in each record."""
        return bool(self.final.states) and self.final is not self.term


class AbstractForced(AbstractTerm):
    """A term that only adds a torque or voltage, linear in the amplitudes that are scored."""

    @abstractmethod
    def forces(self, record: Record, current: Array, speed: Array, starts: Array) -> Array:
        """Torque [N m] or voltage [V] along a trajectory.

        Args:
            record: The record.
            current: (n_sample,) [A].
            speed: (n_sample,) [rad/s].
            starts: (n_parameter, n_start) values of the parameters.

        Returns:
            (n_sample, n_start).
        """


def amplitude(
    name: str, unit: str, meaning: str, size: float, *, signed: bool = False
) -> Parameter:
    """Parameter to which the effect is proportional.

    Args:
        name: Name in the result.
        unit: Unit.
        meaning: One phrase.
        size: Scale of the quantity that the effect changes; the prior's standard deviation is
            three times as large [unit].
        signed: Whether it may be negative.
    """
    return Parameter(
        name, unit, meaning, scale=size, lower=-np.inf if signed else 0.0, prior_sd=3.0
    )


def asymmetry() -> Parameter:
    """Parameter for the difference between two directions, as in contacts or preloaded bearings."""
    return Parameter(
        "asymmetry",
        "-",
        "(forward - reverse) / (forward + reverse)",
        scale=0.1,
        lower=-0.6,
        upper=0.6,
        prior_sd=2.0,
    )


def shape(name: str, unit: str, meaning: str, lower: float, upper: float) -> Parameter:
    """Positive shape parameter, searched in its logarithm.

    The prior is normal in the logarithm and broad: its standard deviation is twice that of a
    uniform distribution between the bounds.

    Args:
        name: Name in the result.
        unit: Unit.
        meaning: One phrase.
        lower: Smallest value that is distinguishable from a limit case [unit].
        upper: Largest such value [unit].
    """
    middle = float(np.sqrt(lower * upper))
    width = float(np.log(upper / lower) / np.sqrt(12.0))
    return Parameter(
        name,
        unit,
        meaning,
        search="log",
        lower=lower,
        upper=upper,
        prior_mean=middle,
        prior_sd=2.0 * width,
    )


def columns(*starts: Sequence[float]) -> Array:
    """(n_parameter, n_start) matrix of starting vectors."""
    return np.array(starts, dtype=np.float64).T
