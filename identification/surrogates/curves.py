"""Candidate spline curves in every signal that varies in a campaign.

The part of each basis function that is collinear with a nominal parameter is removed (a straight
line in speed is viscous friction), so the nominal parameters keep their meaning during the search.
The data cannot attribute that part; `selection.non_identifiable` adds it to the final model.

The principal angles between the span of the basis and the span of current and speed give the
directions that both contain (canonical correlations).  A direction that is only similar does not
count, since the data can separate it.

Source: Bjorck and Golub, Mathematics of Computation 27 (1973), 579-594 (angles between subspaces).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Final

import numpy as np

from identification.arrays import Array
from identification.effects.effect import CampaignScales, Candidate
from identification.model.excitation import Record
from identification.model.term import AbstractTorque, AbstractVoltage, Expression, Signals, Values
from identification.surrogates.curve import HEIGHTS, REGRESSORS, AbstractCurve

__all__ = ["MissingTorque", "MissingVoltage", "collinear", "is_formed", "sampled"]

_NEAR_ZERO: Final = 0.15
_LOOKED_AT: Final = 500
_SAME: Final = 0.98
"""Squared cosine above which directions count as collinear: at most 2 % of their power differs."""
_SEEN: Final = 1e-8
_FALLING: Final = 0.5
"""Slope of a falling voltage, over that of the logged one; half of it may be a line [-]."""
_OVERSHOOT: Final = 0.1
"""Fraction of the range in which a spline may overshoot beside a kink [-]."""


@dataclass(frozen=True)
class _Missing(AbstractCurve):
    """Curve in place of an effect that the catalogue lacks."""

    pairs: ClassVar[tuple[tuple[str, str], ...]]  # signal and carrier of each curve

    @classmethod
    def candidates(cls, scales: CampaignScales) -> list[Candidate]:
        size = scales.torque if cls.equation == "mechanical" else scales.voltage
        terms = (_curve(cls, scales, along, carrier, size) for along, carrier in cls.pairs)
        starts = 0.05 * size * np.eye(HEIGHTS)
        return [Candidate(term, starts, joint=HEIGHTS) for term in terms if term is not None]


@dataclass(frozen=True)
class MissingTorque(_Missing, AbstractTorque):
    """Torque that no effect of the catalogue explains, as a curve."""

    unit = "N m"
    pairs = (
        ("speed", ""),
        ("current", ""),
        ("position", ""),
        ("temperature", ""),
        ("time", ""),
        ("size of torque", "direction"),
        ("temperature", "direction"),
        ("time", "direction"),
        ("time in the run", "direction"),
        ("position", "direction"),
        ("time", "speed"),
        ("time in the run", "speed"),
    )

    def torque(self, signals: Signals, states: Values, values: Values) -> Expression:
        return self.missing(signals, values)


@dataclass(frozen=True)
class MissingVoltage(_Missing, AbstractVoltage):
    """Voltage that no effect of the catalogue explains, as a curve."""

    unit = "V"
    pairs = (
        ("current", ""),
        ("speed", ""),
        ("voltage", ""),
        ("temperature", ""),
        ("time", ""),
        ("size of speed", "current"),
        ("time", "current"),
        ("time in the run", "current"),
        ("position", ""),
    )

    def flaw(self, values: Mapping[str, float]) -> str:
        """Reason to reject a motor voltage that falls while the logged one rises; else empty.

        An amplifier lets it rise, and a loss keeps it at least constant.  If the resistance of the
        source lowers the logged voltage by the current, a curve over it can stand for any Ra25 and
        Kt25, and its slope then has the wrong sign.
        """
        if self.along != "voltage":
            return ""
        heights = np.array([values[f"height_{k}"] for k in range(1, HEIGHTS + 1)])
        logged, lost = self.over_signal(heights)
        falls = 1.0 - np.gradient(lost, logged) < -_FALLING
        share = float(np.sum(np.diff(logged) * falls[1:]) / np.ptp(logged))
        if share <= _OVERSHOOT:
            return ""
        return (
            f"implausible: over {100 * share:.0f} % of the range of the logged voltage, that "
            "of the motor would fall while the logged one rises"
        )

    def voltage(self, signals: Signals, states: Values, values: Values) -> Expression:
        return self.missing(signals, values)


def _curve(
    kind: type[AbstractCurve], scales: CampaignScales, along: str, carrier: str, size: float
) -> AbstractCurve | None:
    """The curve along a signal, or None if the signal is not logged or hardly varies."""
    if along == "position" and not scales.angle_logged:
        return None
    if along == "temperature" and scales.heated < 5.0:
        return None
    logged = {"speed": scales.speed, "voltage": scales.voltage}
    logged |= dict.fromkeys(("current", "torque"), scales.current)
    zero = _NEAR_ZERO * logged.get(along.removeprefix("size of "), 1.0)
    runs = _lengths(scales.records)
    starts = tuple(float(s) for s in np.concatenate([[0.0], np.cumsum(runs)]))
    sizes = zero, scales.speed, scales.current
    warming = scales.nominal("alpha_Kt")
    term = kind(along, carrier, size, 0.0, 1.0, *sizes, starts, warming=warming)
    if along == "position":
        lower, upper = 0.0, 2 * np.pi
    elif along.startswith("time"):
        lower, upper = 0.0, float(np.sum(runs) if along == "time" else np.max(runs))
    else:
        drawn = [term.drawn(record, *record.measured.T)[0] for record in scales.records]
        lower, upper = (float(q) for q in np.quantile(np.concatenate(drawn), (0.001, 0.999)))
    if not upper > lower:
        return None
    return _without_collinear(replace(term, lower=lower, upper=upper), scales)


def _lengths(records: tuple[Record, ...]) -> Array:
    """Duration of each run up to the last, zero for run numbers that are absent [s]."""
    last = max(record.run for record in records)
    lengths = np.zeros(last + 1)
    for record in records:
        lengths[record.run] = max(lengths[record.run], float(record.time[-1]))
    return lengths


def _without_collinear(term: AbstractCurve, scales: CampaignScales) -> AbstractCurve:
    """The curve without the directions that are collinear with its signal.

    A line in the current or speed is a part of a nominal parameter, one in the voltage a common
    factor on all of them.
    """
    places = [k for k, name in enumerate(REGRESSORS) if name in term.drivers]
    if not places:
        return term
    columns, regressors = sampled(term, scales.records)
    lines, amounts = collinear(columns, regressors[:, places])
    pairs = zip(lines.T.tolist(), amounts.tolist(), strict=True)
    return replace(term, removed=tuple((tuple(line), tuple(amount)) for line, amount in pairs))


def sampled(term: AbstractCurve, records: Sequence[Record]) -> tuple[Array, Array]:
    """Basis (n_sample, n_coefficient) and regressors of a curve on a subset of the samples.

    The regressors (n_sample, 3) are current, speed and voltage, each over its scale [-].
    """
    columns, regressors = [], []
    for record in records:
        sparse = record.at(slice(None, None, max(record.rows // _LOOKED_AT, 1)))
        current, speed = sparse.measured.T
        columns.append(term.columns(sparse, current, speed))
        sizes = (current / term.current, speed / term.speed, sparse.column("voltage") / term.size)
        regressors.append(np.column_stack(sizes))
    return np.concatenate(columns), np.concatenate(regressors)


def collinear(basis: Array, signals: Array) -> tuple[Array, Array]:
    """Directions of a basis (n_sample, n_function) that signals (n_sample, n_signal) share.

    The signals are linearly independent.

    Returns:
        (n_function, n_shared) coefficients of the directions, as close to the span of the signals
        as the basis allows, and (n_shared, n_function) the least-squares amount of each direction
        in each basis function.  The amount of each direction in itself is one.
    """
    own = np.linalg.qr(signals)[0]
    cosine, directions = np.linalg.svd(_orthonormal(basis).T @ own, full_matrices=False)[1:]
    shared = own @ directions[cosine**2 > _SAME].T
    lines = np.linalg.lstsq(basis, shared, rcond=_SEEN)[0]
    return lines, np.linalg.lstsq(basis @ lines, basis, rcond=_SEEN)[0]


def is_formed(basis: Array, signal: Array) -> bool:
    """True if a signal (n_sample,) lies in the span of a basis (n_sample, n_function), as above."""
    inside = _orthonormal(basis).T @ signal
    return bool(inside @ inside > _SAME * (signal @ signal))


def _orthonormal(basis: Array) -> Array:
    """(n_sample, n_direction) orthonormal basis of the column space."""
    left, sizes, _ = np.linalg.svd(basis, full_matrices=False)
    return np.asarray(left[:, sizes > _SEEN * max(float(sizes[0]), 1e-300)])
