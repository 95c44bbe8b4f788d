"""What the search needs to know of an effect besides its physics.

An effect is a term (`model.term`) that also says where to look for itself: `candidates` returns
finite-size prototypes for the motor at hand.  A prototype of finite size is used and not the
derivative at zero, since the derivative of a filter or lag vanishes there and that of friction
near standstill is not the effect's shape.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.effects.orders import HIGHEST_ORDER, orders_of
from identification.fit.solve import Fit
from identification.model.excitation import Record
from identification.model.parameter import Parameter
from identification.model.term import AbstractDelay, AbstractHold, AbstractMean, AbstractTerm

__all__ = [
    "AbstractForced",
    "Candidate",
    "Survey",
    "amplitude",
    "asymmetry",
    "columns",
    "shape",
    "survey_of",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Survey:
    """Natural sizes of one campaign, from its signals and its declared fit.

    Args:
        records: Training records.
        current: Size of the current [A].
        speed: Size of the speed [rad/s].
        voltage: Size of the voltage [V].
        torque: Kt25 times the size of the current [N m].
        interval: Median sample interval [s].
        duration: Longest record [s].
        speed_noise: Residual deviation of the speed [rad/s].
        current_noise: Residual deviation of the current [A].
        values: (7,) declared parameters, physical.
        angle_logged: Whether the shaft angle is logged, and not integrated from the speed.
        orders: Periods a revolution that stand out of the residual [-].
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
        """Numbers of the training runs, in order."""
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
    """One model structure to try, with places to start from.

    Args:
        term: The term, its fields set for this motor.
        starts: (n_parameter, n_start) physical values, each of finite size.
        joint: Neighbouring starts that add up linearly and are scored together.
        fitted: The term that is fitted, where it differs from the one that is scanned: its
            parameters are the first of the scanned term's, and its states hold the rest, free in
            each record.  Such starts are scored record by record.
        by_run: Whether the term concerns one run, its field `run`.  It is scanned in all runs at
            once, with `run` None, and scored for each.
        recurs: Whether such a term may also concern several runs alike, its field `others`.
        tried: (n_parameter, n_place) further places that a refit simulates, where no score tells
            how good one is.
        traded: Further places of the same kind, each with the factors by which parameters that are
            in the model already change there: what had taken the effect's part gives it back.
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
        """Number of starts; one where there is nothing to start from."""
        return max(int(self.starts.shape[1]), 1)

    @property
    def prototypes(self) -> int:
        """Number of prototypes that are scored by themselves, in one run where runs differ."""
        return max(self.lanes // self.joint, 1)

    @property
    def can_rest(self) -> bool:
        """Whether the term can be in a model without doing anything there."""
        if self.term.states or isinstance(self.term, AbstractDelay | AbstractHold | AbstractMean):
            return False
        return any(parameter.vanishes for parameter in self.term.parameters)

    @property
    def resting(self) -> Array:
        """(n_parameter,) values at which the term does nothing, where it can rest."""
        first = self.starts.reshape(-1, self.lanes)[:, 0].copy()
        for row, parameter in enumerate(self.term.parameters):
            if parameter.vanishes:
                first[row] = 0.0
        return first

    def in_runs(self, run: int, *others: int) -> Candidate:
        """The candidate of one run, or of several where it recurs."""
        term: Any = self.term
        own = {"run": run} | ({"others": others} if others else {})
        return replace(self, term=replace(term, **own), by_run=False, recurs=False)

    @property
    def final(self) -> AbstractTerm:
        """The term that a refit uses."""
        return self.fitted or self.term

    @property
    def by_record(self) -> bool:
        """Whether amplitudes are free in each record."""
        return bool(self.final.states) and self.final is not self.term


class AbstractForced(AbstractTerm):
    """A term that is a force over time, in proportion to what is scored, and nothing else."""

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


def survey_of(fit: Fit) -> Survey:
    """Natural sizes of the campaign that `fit` was made on."""
    records = fit.simulator.records
    measured = np.concatenate([record.measured for record in records])
    voltage = np.concatenate([record.column("voltage") for record in records])
    size = np.sqrt(np.mean(measured**2, axis=0))
    size = np.where(size > 0, size, 1.0)
    intervals = np.concatenate([record.inputs[:-1, 0] for record in records])
    return Survey(
        records=tuple(records),
        current=float(size[0]),
        speed=float(size[1]),
        voltage=float(np.sqrt(np.mean(voltage**2))) or 1.0,
        torque=float(fit.values[2] * size[0]),
        interval=float(np.median(intervals)),
        duration=float(max(record.time[-1] - record.time[0] for record in records)),
        current_noise=float(fit.weighting.deviation[0]),
        speed_noise=float(fit.weighting.deviation[1]),
        values=fit.values[:7].copy(),
        angle_logged=all(record.angle_logged for record in records),
        orders=orders_of(records, fit.residuals(), HIGHEST_ORDER),
    )


def amplitude(
    name: str, unit: str, meaning: str, size: float, *, signed: bool = False
) -> Parameter:
    """A parameter that the effect is proportional to.

    Args:
        name: Name in the result.
        unit: Unit.
        meaning: One phrase.
        size: Natural size of what it is compared with [unit].
        signed: Whether it may be negative.
    """
    return Parameter(
        name, unit, meaning, scale=size, lower=-np.inf if signed else 0.0, prior_sd=3.0
    )


def asymmetry() -> Parameter:
    """How far two directions differ, as contacts and preloaded bearings do."""
    return Parameter(
        "asymmetry",
        "-",
        "half the difference between the directions over their mean",
        scale=0.1,
        lower=-0.6,
        upper=0.6,
        prior_sd=2.0,
    )


def shape(name: str, unit: str, meaning: str, lower: float, upper: float) -> Parameter:
    """A positive parameter that gives the effect its form, flat in its logarithm.

    Args:
        name: Name in the result.
        unit: Unit.
        meaning: One phrase.
        lower: Smallest value that differs from a limit case [unit].
        upper: Largest [unit].
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
    """(n_parameter, n_start) from starting vectors."""
    return np.array(starts, dtype=np.float64).T
